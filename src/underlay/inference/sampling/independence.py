"""Proposals from a frozen mixture, whatever the place of a walker."""

from __future__ import annotations

from typing import Any

import emcee
import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.ridge.coordinates import FARTHEST, PriorNormal
from underlay.inference.ridge.mixture import Mixture

__all__ = ["IndependenceMove", "Tallied"]


class IndependenceMove(emcee.moves.MHMove):  # type: ignore[misc]  # emcee ships no types
    """Independence sampler: Tierney (1994), doi:10.1214/aos/1176325750.

    The mixture lives where the prior is a standard normal, cut where |z| is 7.5; in the walkers' coordinates its
    density is that times |dz/dq|.

    Parameters
    ----------
    coordinates : PriorNormal
        The way between the two.
    mixture : Mixture
        Frozen: one that learns from the chain would bend it.
    """

    def __init__(self, coordinates: PriorNormal, mixture: Mixture) -> None:
        super().__init__(self._proposed, ndim=coordinates.size)
        self._coordinates, self._mixture = coordinates, mixture

    def log_proposal(self, vectors: FloatArray, z: FloatArray | None = None) -> FloatArray:
        """Log-density (m,) with which scaled vectors (m, p), at `z`, are proposed; -inf where they never are."""
        places = self._coordinates.normal(vectors) if z is None else z
        result = np.full(len(vectors), -np.inf)
        near = (np.abs(places) < FARTHEST).all(axis=1)
        slopes = self._coordinates.log_slope(vectors[near], places[near])
        result[near] = self._mixture.log_density(places[near]) + slopes
        return result

    def _proposed(self, vectors: FloatArray, random: np.random.RandomState) -> tuple[FloatArray, FloatArray]:
        """Proposals (m, p) for walkers at scaled vectors (m, p), with ln q(old) - ln q(new), (m,)."""
        z = self._mixture.draw(len(vectors), random)
        near = (np.abs(z) < FARTHEST).all(axis=1)
        # What is cut away is proposed to nobody: such a walker stays, and its density is not asked for elsewhere.
        proposals = vectors.copy()
        proposals[near] = self._coordinates.scaled(z[near])
        both = np.concatenate([self._coordinates.normal(vectors), z])
        old, new = np.split(self.log_proposal(np.concatenate([vectors, proposals]), both), 2)
        possible = near & np.isfinite(new)
        return proposals, np.where(possible, old - np.where(possible, new, 0.0), -np.inf)


class Tallied:
    """A move of emcee's with a count of what became of its proposals.

    Parameters
    ----------
    move : emcee.moves.Move
        The move.
    """

    def __init__(self, move: Any) -> None:
        self.move = move
        self.name = type(move).__name__
        self.proposed = self.accepted = 0

    def propose(self, model: Any, state: Any) -> tuple[Any, NDArray[np.bool_]]:
        """Make the move."""
        state, accepted = self.move.propose(model, state)
        self.proposed += len(accepted)
        self.accepted += int(np.sum(accepted))
        return state, accepted
