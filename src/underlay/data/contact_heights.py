"""Layer thickness at each site of a map, from contact heights on the sample and on the bare substrate beside it.

All curves must count depth from one common zero, as for a piezo or stage that is not moved in between. Then the
depth reading of a contact is a height in space, and two of them differ by the thickness.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray

__all__ = ["Thicknesses", "thickness_of_heights"]

# Least ratio of the directions of a plane for which it is one and no line: the sine of one degree.
_LEAST_SINE = 0.017


class Thicknesses(NamedTuple):
    """Thickness (m) at every curve, its standard uncertainty (m), each (curves,), and whether the plane is tilted.

    On the bare substrate the thickness is how far the plane misses the contact.
    """

    thickness: FloatArray
    error: FloatArray
    is_tilted: bool


def thickness_of_heights(
    height: FloatArray, error: FloatArray, bare: NDArray[np.bool_], places: Sequence[tuple[float, ...]]
) -> Thicknesses:
    """Layer thickness from the depths at which curves meet the sample, and the bare substrate beside it.

    The surface of the substrate is the least-squares plane through the contacts of at least three curves on it, if
    all curves have places and these are not on a line; otherwise it is taken as level.

    Parameters
    ----------
    height, error : FloatArray
        Depth of contact from the common zero, growing into the sample, and its standard uncertainty (m), (curves,).
    bare : ndarray of bool (curves,)
        Which curves are on the bare substrate; at least one.
    places : sequence of tuple of float
        Position (x, y) (m) of every curve; empty where it is not known.

    Returns
    -------
    Thicknesses
        Its error has that of the contact point, and that of the plane: of its contact points, or as these scatter
        about it where that is more.
    """
    terms = _terms(places, bare)
    plane, _, _, _ = np.linalg.lstsq(terms[bare], height[bare], rcond=None)
    thickness = terms @ plane - height
    freedom = int(bare.sum()) - terms.shape[1]
    scatter = float(np.sqrt(np.sum(thickness[bare] ** 2) / freedom)) if freedom > 0 else 0.0
    reach = np.einsum("ij,jk,ik->i", terms, np.linalg.inv(terms[bare].T @ terms[bare]), terms)
    of_plane = max(scatter, float(np.sqrt(np.mean(error[bare] ** 2)))) * np.sqrt(reach)
    return Thicknesses(thickness, np.hypot(error, of_plane), terms.shape[1] > 1)


def _terms(places: Sequence[tuple[float, ...]], bare: NDArray[np.bool_]) -> FloatArray:
    """Return the design matrix (curves, 1 or 3) of the substrate's height: a constant and, for a plane, x and y.

    `bare` marks the curves on the substrate; a plane needs at least three of them that are not on a line.
    """
    level = np.ones((len(places), 1))
    # A plane has three corners.
    if bare.sum() < 3 or not all(places):
        return level
    across = np.array(places, dtype=float)
    across -= across[bare].mean(axis=0)
    directions = np.linalg.svd(across[bare], compute_uv=False)
    return np.hstack((level, across)) if directions[1] > _LEAST_SINE * directions[0] else level
