"""Adhesion on a layer: JKR, DMT and Maugis-Dugdale, all from the flat punch that the exact law solves."""

from underlay.mechanics.adhesion.jkr import JKR
from underlay.mechanics.adhesion.maugis import DMT, Maugis
from underlay.mechanics.contact import Adhesion

__all__ = ["DMT", "JKR", "Adhesion", "Maugis"]
