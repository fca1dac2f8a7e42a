"""One place of the search of `separable`: the model there, linear in all but the contact, and the step from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log, nan

import numpy as np

from underlay._arrays import FloatArray

__all__ = ["ContactStep", "LinearModel", "solved"]

_FARTHEST = log(1e6)  # a step of E beyond is none: the force hardly depends on it


@dataclass(frozen=True)
class LinearModel:
    """Model at one contact, the linear parameters solved for.

    Parameters
    ----------
    modulus : float
        Of the layer (Pa), of the law.
    power : float
        d ln P / d ln E; one where the force is proportional to the modulus.
    columns : FloatArray
        d model / d linear parameter, brought to unit length, (p, n); the first is dP/d ln E.
    products : FloatArray
        Their inner products, (p, p).
    lengths : FloatArray
        What they were divided by, (p,).
    weights : FloatArray
        Solution in the unit columns, (p,).
    stiffness : FloatArray
        dP/dw (N/m), (n,).
    residuals : FloatArray
        Data minus model (N), (n,).
    sum_of_squares : float
        Of them.
    law_method, law_error
        Of the contact law.
    """

    modulus: float
    power: float
    columns: FloatArray
    products: FloatArray
    lengths: FloatArray
    weights: FloatArray
    stiffness: FloatArray
    residuals: FloatArray
    sum_of_squares: float
    law_method: str
    law_error: float

    @property
    def linear(self) -> FloatArray:
        """One more than the change of ln E to first order, then baseline and slope (SI) as far as free, (p,)."""
        return self.weights / self.lengths

    @property
    def gain(self) -> float:
        """Force over that of the law, taken for a power of the modulus."""
        return 1.0 + self.power * (float(self.linear[0]) - 1.0)

    def turn(self, step: ContactStep) -> float:
        """Change of ln E that goes with a step of the contact; NaN where no modulus within decades will do."""
        after = self.after(step).gain
        turn = log(after) / self.power if after > 0.0 < self.power else nan
        return turn if abs(turn) < _FARTHEST else nan

    def step(self) -> ContactStep:
        """Kaufman's step of the contact depth; of NaN metres where the contact does not act."""
        along = solved(self.products, self.columns @ self.stiffness)
        across = self.stiffness - along @ self.columns
        power, gain = float(across @ across), self.gain
        if not (power > 0.0 and gain > 0.0):
            return ContactStep(nan, along, across)
        return ContactStep(-float(across @ self.residuals) / (gain * power), along, across)

    def after(self, step: ContactStep) -> LinearModel:
        """The model after a step so short that it is linear there."""
        change = self.gain * step.length
        residuals = self.residuals + change * step.across
        return replace(
            self,
            weights=self.weights + change * step.along,
            residuals=residuals,
            sum_of_squares=float(residuals @ residuals),
        )


@dataclass(frozen=True)
class ContactStep:
    """Length (m) of a step of the contact; the stiffness along (p,) and across (n,) the linear columns."""

    length: float
    along: FloatArray
    across: FloatArray


def solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a small symmetric system; a single equation needs no library."""
    return np.asarray(right / matrix[0, 0] if len(right) == 1 else np.linalg.solve(matrix, right))
