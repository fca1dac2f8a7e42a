"""Curves as nanite takes them."""

import numpy as np


def indentation(nanite, depth, force, name="x"):
    """Return the curve as an `Indentation` of one approach; nanite's tip moves towards smaller positions."""
    n = len(depth)
    return nanite.indent.Indentation(
        data={
            "force": force,
            "tip position": -depth,
            "time": np.arange(n) * 1e-3,
            "segment": np.zeros(n, dtype=np.uint8),
        },
        metadata={
            "spring constant": 1.0,
            "imaging mode": "force-distance",
            "point count": n,
            "path": name,
            "enum": 1,
        },
    )
