"""One curve with a layer's lower face bonded, and free to slip: what each would have reported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from underlay._given import require_given
from underlay.errors import FitError, InputError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import fit
from underlay.inference.problem import Problem
from underlay.scene.faces import bond_of, faces, has_face, with_bond

__all__ = ["BondComparison", "compare_bonds"]

#: What each bond is called, and the value that a layer's `bond` takes.
_BONDS = {"bonded": "bonded", "slipping": "slip"}


@dataclass(frozen=True, eq=False)
class BondComparison:
    """Fits of the same data with one face bonded, and free to slip.

    Parameters
    ----------
    face : str
        The layer whose lower face it is: ``"layer"``, ``"substrate.layers[0]"``, ...
    names : tuple of str
        Free parameters.
    fits : mapping of str to Fit
        ``"bonded"`` and ``"slipping"``, those that could be fitted.
    refused : mapping of str to str
        Why one could not.
    """

    face: str
    names: tuple[str, ...]
    fits: Mapping[str, Fit]
    refused: Mapping[str, str]

    @property
    def difference(self) -> float:
        """AIC of the slipping face above that of the bonded one: negative where the data speak for slip.

        NaN where one could not be fitted.
        """
        if self.refused:
            return np.nan
        slipping, bonded = (self.fits[name].statistics.aic for name in ("slipping", "bonded"))
        return slipping - bonded

    def to_frame(self, level: float = 0.95) -> pd.DataFrame:
        """One row per bond and parameter.

        Returns
        -------
        pandas.DataFrame
            ``face``, ``parameter``, ``value``, ``low`` and ``high`` of its interval (SI; infinite where open),
            ``rms residual`` (N) and ``AIC`` above the smaller.
        """
        least = min((found.statistics.aic for found in self.fits.values()), default=0.0)
        rows = []
        for bond, found in self.fits.items():
            rms = float(np.sqrt(np.mean(np.square(np.concatenate(found.residuals)))))
            for name in self.names:
                known = found.interval(name, level)
                row = {"face": bond, "parameter": name, "value": known.value}
                row |= {"low": known.low, "high": known.high}
                rows.append(row | {"rms residual": rms, "AIC": found.statistics.aic - least})
        return pd.DataFrame(rows)


def compare_bonds(given: Problem | Fit, face: str = "layer") -> BondComparison:
    """Fit the same data with a layer bonded to what is under it, and free to slip on it.

    A gel that lies loose in a dish carries up to 40 % less force at equal depth than one that sticks to it: where
    nobody knows, the two moduli are the honest answer.

    Parameters
    ----------
    given : Problem or Fit
        Data, free parameters, noise and solver. The bond of a fit is not fitted again.
    face : str, default "layer"
        The layer whose lower face it is: ``"layer"`` for the one on top, ``"substrate.layers[0]"`` for the next.

    Returns
    -------
    BondComparison
        A bond that cannot be fitted is listed with the reason.

    Raises
    ------
    InputError
        If there is no such face.
    """
    require_given(given, "given", Problem, Fit)
    problem = given.problem if isinstance(given, Fit) else given
    for scene in problem.base_scenes:
        if not has_face(scene, face):
            known = ", ".join(faces(scene)) or "none"
            raise InputError(f"no layer {face!r} with something under it; such faces here: {known}")
    fits: dict[str, Fit] = {}
    refused: dict[str, str] = {}
    for name, bond in _BONDS.items():
        scenes = [with_bond(scene, face, bond) for scene in problem.base_scenes]
        try:
            # An unknown bond is computed as bonded: that fit is the one at hand.
            if isinstance(given, Fit) and all(bond_of(scene, face) == bond for scene in problem.base_scenes):
                fits[name] = given
            else:
                fits[name] = fit(problem.revised(scenes=scenes))
        except (InputError, FitError) as error:
            refused[name] = str(error)
    return BondComparison(face, problem.names, fits, refused)
