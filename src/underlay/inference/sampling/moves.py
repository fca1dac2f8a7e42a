"""How the walkers of an ensemble move.

Every move is invariant under linear maps, so a strong correlation costs nothing. Draws from a kernel estimate
of the other half follow a bent ridge: half the autocorrelation time of differences alone, a quarter of
stretches alone, on a modulus, thickness and contact point. Differences of walkers (ter Braak 2006,
doi:10.1007/s11222-006-8769-1) and stretches (Goodman and Weare 2010, doi:10.2140/camcos.2010.5.65) take over
where the estimate is poor; a full difference (gamma0 = 1) jumps between separate tops. emcee's snooker is
left out: up to version 3.1.6 it divides by the root of a length where the length belongs, and the variance it
yields is too small.

Where a mixture lies along the ridges of the posterior most proposals come from it, whatever the place of a walker:
on a layer with its base, 179 effective draws in 1000 evaluations against 1.2 with the others alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import emcee
import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.inference.ridge.coordinates import FARTHEST, PriorNormal
from underlay.inference.ridge.mixture import Mixture

__all__ = ["IndependenceMove", "KernelMove", "Tallied", "moves"]


# Share of the steps that propose from the mixture. With 0.6 a posterior takes a third longer (median of 27, in
# pairs): the other moves hardly forget where a walker was. But where a ridge goes on beyond the mixture they alone
# lead there.
_INDEPENDENT, _INDEPENDENT_OPEN = 0.8, 0.6
# Proposals of the mixture that a walker gets in a step.
_AT_ONCE = 3


def moves(
    independent: emcee.moves.Move | None = None, *, is_open: bool = False
) -> list[tuple[emcee.moves.Move, float]]:
    """Moves and how often each is made: most often the independent one, less often where its mixture is open."""
    share = 0.0 if independent is None else _INDEPENDENT_OPEN if is_open else _INDEPENDENT
    others = 1.0 - share
    walking = [
        (KernelMove(), 0.40 * others),
        (emcee.moves.DEMove(), 0.35 * others),
        (emcee.moves.DEMove(gamma0=1.0), 0.05 * others),
        (emcee.moves.StretchMove(), 0.20 * others),
    ]
    return walking if independent is None else [(independent, share), *walking]


class KernelMove(emcee.moves.RedBlueMove):  # type: ignore[misc]  # emcee ships no types
    """Independent draws from a Gaussian kernel estimate of the complementary ensemble.

    The kernel has the ensemble's covariance times n^(-2 / (p + 4)), Scott's rule. The same move as
    ``emcee.moves.KDEMove``, without threaded linear algebra on matrices of a dozen numbers, which on a busy
    machine waits a thousand times longer than it works.
    """

    def get_proposal(
        self, sample: FloatArray, complement: list[FloatArray], random: np.random.RandomState
    ) -> tuple[FloatArray, FloatArray]:
        """Draw proposals (m, p) for `sample` (m, p), with log q(old) - log q(new), (m,)."""
        others = np.concatenate(complement)
        count, parameters = others.shape
        deviations = others - others.mean(axis=0)
        covariance = np.einsum("ni,nj->ij", deviations, deviations) / (count - 1)
        factor = np.linalg.cholesky(covariance) * count ** (-1.0 / (parameters + 4))
        shifts = np.einsum("mi,ji->mj", random.randn(len(sample), parameters), factor)
        proposals = others[random.randint(count, size=len(sample))] + shifts
        whiten = np.linalg.inv(factor)
        old_and_new = np.einsum("mi,ji->mj", np.concatenate([sample, proposals]), whiten)
        centres = np.einsum("mi,ji->mj", others, whiten)
        squares = np.square(old_and_new[:, None, :] - centres).sum(axis=-1)
        nearest = squares.min(axis=-1, keepdims=True)
        log_density = np.log(np.exp(0.5 * (nearest - squares)).sum(axis=-1)) - 0.5 * nearest[:, 0]
        return proposals, log_density[: len(sample)] - log_density[len(sample) :]


class IndependenceMove(emcee.moves.Move):  # type: ignore[misc]  # emcee ships no types
    """Independence sampler, several proposals a step: Tierney (1994), doi:10.1214/aos/1176325750.

    The mixture lives where the prior is a standard normal, cut where |z| is 7.5; in the walkers' coordinates its
    density is that times |dz/dq|. What is proposed does not depend on where a walker is: the densities of all that
    a step proposes are asked for together, which costs little more than those of one proposal each.

    Parameters
    ----------
    coordinates : PriorNormal
        The way between the two.
    mixture : Mixture
        Frozen: one that learns from the chain would bend it.
    density : callable
        Log-posterior (m,) of scaled vectors (m, p).
    """

    def __init__(
        self, coordinates: PriorNormal, mixture: Mixture, density: Callable[[FloatArray], FloatArray]
    ) -> None:
        self._coordinates, self._mixture, self._density = coordinates, mixture, density

    def log_proposal(self, vectors: FloatArray, z: FloatArray | None = None) -> FloatArray:
        """Log-density (m,) with which scaled vectors (m, p), at `z`, are proposed; -inf where they never are."""
        places = self._coordinates.normal(vectors) if z is None else z
        result = np.full(len(vectors), -np.inf)
        near = (np.abs(places) < FARTHEST).all(axis=1)
        slopes = self._coordinates.log_slope(vectors[near], places[near])
        result[near] = self._mixture.log_density(places[near]) + slopes
        return result

    def propose(self, model: Any, state: Any) -> tuple[Any, NDArray[np.bool_]]:
        """Let every walker accept or decline its proposals one after another; whether it did, (proposals x m,)."""
        walkers = len(state.coords)
        z = self._mixture.draw(_AT_ONCE * walkers, model.random)
        near = (np.abs(z) < FARTHEST).all(axis=1)
        # What is cut away is proposed to nobody: such a walker stays, and its density is not asked for elsewhere.
        proposals = np.tile(state.coords, (_AT_ONCE, 1))
        proposals[near] = self._coordinates.scaled(z[near])
        # Log-weights: posterior over proposal, of which a walker takes the next with the ratio.
        log_posterior = self._density(proposals)
        proposed = self.log_proposal(proposals, z)
        possible = near & np.isfinite(proposed)
        fresh = np.where(possible, log_posterior - np.where(possible, proposed, 0.0), -np.inf)
        weight = state.log_prob - self.log_proposal(state.coords)
        chance = np.log(model.random.rand(_AT_ONCE, walkers))
        accepted = np.zeros((_AT_ONCE, walkers), dtype=bool)
        for turn, rows in enumerate(np.arange(_AT_ONCE * walkers).reshape(_AT_ONCE, walkers)):
            taken = accepted[turn] = chance[turn] < fresh[rows] - weight
            weight = np.where(taken, fresh[rows], weight)
            state.coords[taken] = proposals[rows[taken]]
            state.log_prob[taken] = log_posterior[rows[taken]]
        return state, accepted.ravel()


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
