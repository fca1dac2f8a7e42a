"""Contacts without slip, solved by other means: ``tests/data/stuck_references.txt`` says how and in which units."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

STORED = Path(__file__).parents[1] / "data" / "stuck_references.txt"


class StuckReference(NamedTuple):
    """kappa, and w/(A a^lambda) and P/(theta A a^(lambda+1)) of a paraboloid and of a cone."""

    nu: float
    base: float | None
    eps: float
    kappa: float
    paraboloid: tuple[float, float]
    cone: tuple[float, float]


_ALL = [
    StuckReference(nu, None if base == np.inf else base, eps, kappa, (row[0], row[1]), (row[2], row[3]))
    for nu, base, eps, kappa, *row in np.loadtxt(STORED).tolist()
]
REFERENCES = [one for one in _ALL if one.eps <= 4.0]
#: Wide contacts on thin layers.
WIDE = [one for one in _ALL if one.eps > 4.0]
