"""A layer that stiffens as it is indented, and finite strain: factors on the exact law of a sphere.

`factors` are the formulas, those of a contact made little by little among them, `limits` what is refused, and `law`
the numbers of a layer (`Gent`) and the law of its contact.
"""

from underlay.mechanics.stiffening.factors import (
    FIRST_TOUCH,
    FORM_SPREAD,
    LogFactor,
    Medium,
    Place,
    form,
    gent,
    neo_hookean,
)
from underlay.mechanics.stiffening.law import MARGIN, Gent, StiffeningLaw, StiffLayer, at_values
from underlay.mechanics.stiffening.limits import largest_by_depth, require_known, within_reach

__all__ = [
    "FIRST_TOUCH",
    "FORM_SPREAD",
    "MARGIN",
    "Gent",
    "LogFactor",
    "Medium",
    "Place",
    "StiffLayer",
    "StiffeningLaw",
    "at_values",
    "form",
    "gent",
    "largest_by_depth",
    "neo_hookean",
    "require_known",
    "within_reach",
]
