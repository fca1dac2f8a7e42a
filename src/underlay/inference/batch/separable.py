"""The fit a map repeats ten thousand times: a modulus, a contact point and a baseline.

The reading is

    F(d) = P(d - c; E) + baseline + slope d.

Where the layer's modulus is the only one, P is E times a force that stays put: all is linear but c. For a contact
depth c the rest is a linear least-squares problem, so the search runs over c alone (variable projection: Golub and
Pereyra 1973, doi:10.1137/0710036; the step is Kaufman's 1975, doi:10.1007/BF01932995). On an elastic base the law
changes with E / E2: it is taken as linear in ln E about the last one, dP/d ln E is what `LawSlopes` says, and E
moves along with c, nearly as a power of the force. The search ends where `least_squares.fit` ends, on the same sum
of squares. Measured on 1000 points on a rigid base, modulus and contact free: by the engine a whole row of a map
takes 3 times as long, its scan and the making of its problem included (processor time, median of 9 pairs of maps
of 24 curves); on a base ten times stiffer 3.5 times, under a sphere there 3 times. Whatever is unusual (a
parameter near a bound, a step that does not descend, an ill-conditioned set, a depth the law does not reach) is
left to `least_squares.fitting.quick_fit`: the answer is then None.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from underlay.data.curve import Curve
from underlay.errors import InputError
from underlay.inference.batch.separable_search import (
    BASELINE,
    CONTACT,
    MODULUS,
    SLOPE,
    SeparableFit,
    SeparableSearch,
)
from underlay.inference.model.coordinates import Coordinate
from underlay.inference.model.forward import Forward
from underlay.inference.problem import Problem
from underlay.scene.noise import Noise

__all__ = ["SeparableModel"]

_EXPONENT = "indenter.exponent"
_SEPARABLE = frozenset({MODULUS, CONTACT, BASELINE, SLOPE})


@dataclass(frozen=True)
class SeparableModel:
    """What all curves of a map have in common, compiled.

    Parameters
    ----------
    forward : Forward
        Of the common scene; its store holds the laws that curves share.
    coordinates : tuple of Coordinate
        The free parameters.
    noise : float or None
        White noise (N), or None where it is estimated.
    """

    forward: Forward
    coordinates: tuple[Coordinate, ...]
    noise: float | None

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        """Compile the model of a problem of one curve, or return None where it is not separable."""
        if len(problem.members) != 1:
            return None
        member = problem.members[0]
        noise = member.noise
        separable = (
            MODULUS in member.entries
            and member.forward.history is None
            and member.forward.left_out is None
            and member.scene.lever is None
            and set(problem.names) <= _SEPARABLE
            and MODULUS in member.forward.similarity.force_scales
            and not member.forward.similarity.energies
            and (member.forward.similarity.force_scales == (MODULUS,) or member.forward.laws.know_slopes)
            and not any(coordinate.prior.informative for coordinate in problem.coordinates)
            and isinstance(noise, Noise)
            and not (noise.follows_force or noise.correlation)
        )
        known = noise.force if isinstance(noise, Noise) else None
        return cls(member.forward, problem.coordinates, known) if separable else None

    def fit(self, curve: Curve, values: Mapping[str, float]) -> SeparableFit | None:
        """Fit one fittable curve; None hands it to `least_squares.fit`.

        Parameters
        ----------
        curve : Curve
            The points, (n,).
        values : mapping
            Every number of its scene (SI).
        """
        if values["instrument.compliance"]:
            return None
        try:
            forward = self._forward_of(curve, values)
            return SeparableSearch(self.coordinates, self.noise, forward, curve, values).solve()
        except InputError:
            # No law reaches a contact that was tried; the bounded search steps back from such places.
            return None

    def _forward_of(self, curve: Curve, values: Mapping[str, float]) -> Forward:
        """The forward model of a curve; with tables of its own where its scene differs in what those here hold."""
        similarity, laws = self.forward.similarity, self.forward.laws
        served = {MODULUS, similarity.length, *similarity.shape} - {_EXPONENT}
        if laws.table is not None:
            # A table of a stack holds the thicknesses over that of its top layer.
            served = (served - ({similarity.length} if similarity.lengths else set())) | {laws.table.path}
        served |= set() if laws.tips is None else {laws.tips.path, *similarity.lengths}
        own = {
            path: values[path]
            for path, held in similarity.values.items()
            if path not in served and not path.startswith("instrument.") and values[path] != held
        }
        if not own:
            return replace(self.forward, depth=curve.depth)
        scene, free = similarity.scene.with_values(own), [entry.path for entry in self.coordinates]
        return Forward.compile(scene, curve.depth, free, laws.solver, laws.store)
