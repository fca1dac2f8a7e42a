"""Adhesion on a layer: JKR, DMT and Maugis-Dugdale, all from the flat punch that the exact law solves.

`jkr` and `maugis` are the models; `adhesive_law` finds the stable states of a contact and is the law of an adhesive
tip; `radius_relation` has what they need of the elastic contact; `jkr_table` tabulates it for many
parameter sets.
"""

from underlay.mechanics.adhesion.jkr import JKR
from underlay.mechanics.adhesion.maugis import DMT, Maugis
from underlay.mechanics.contact import Adhesion

__all__ = ["DMT", "JKR", "Adhesion", "Maugis"]
