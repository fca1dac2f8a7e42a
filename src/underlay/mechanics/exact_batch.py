"""The exact contact problem for many parameter sets at once, as samplers and maps need it.

All sets share the contact radii, the nodes and the cosines cos(eps x u): only the weights 1 - L(u) change
with the materials, so one matrix product builds every kernel and one batched solve serves every set.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi
from typing import Self

import numpy as np

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay.errors import RangeError
from underlay.mechanics.contact_curve import (
    LARGEST_EPS,
    ContactProblem,
    RadiusGuess,
    contact_factors,
    depth_measure,
    solve_curve,
)
from underlay.mechanics.exact_nodes import Pair, Resolution, curve_terms
from underlay.mechanics.gauss import EvenRule, even_rule
from underlay.mechanics.indenters import Indenter, PowerLawShape
from underlay.mechanics.kernel import one_minus_L
from underlay.mechanics.master_curve import (
    MOST_TERMS,
    Factor,
    MasterCurve,
    Stretch,
    chebyshev_angles,
    monomials,
    polynomial,
    truncation_error,
)
from underlay.mechanics.materials import PlaneConstants
from underlay.mechanics.punch_solution import PunchSolution

__all__ = ["CurveBatch", "ExactBatch"]
