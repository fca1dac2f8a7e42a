"""Adhesion on a layer: JKR, DMT and Maugis-Dugdale, all from the flat punch that the exact law solves."""
