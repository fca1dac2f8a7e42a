"""The log-posterior as a sampler may see it, and the problem that it is of.

The log-posterior as a sampler may see it: never nan, and its failures counted with where they happened.

The problem whose posterior allows for what its fit allows for.
"""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay.errors import FitError, InputError, UnderlayError
from underlay.inference.headline.averaged import averaged_fit
from underlay.inference.least_squares.fitting import quick_fit
from underlay.inference.misfit.marginal import MarginalLikelihood
from underlay.inference.problem import Problem

__all__ = ["CountedDensity", "marginalised"]

# The same density in another batch repeats to rounding times the condition of the contact problem, far below
# a thousandth of a log unit; another problem differs by log units.
_SAME_DENSITY = 1e-3


# Sets that are asked for together: of more, what is in between does not stay in the processor's near memory.
_TOGETHER = 256


class CountedDensity:
    """Callable (m, p) -> (m,) that gives -inf for a failed evaluation and remembers it.

    An evaluation fails when the prior allows the parameters and the model has no finite likelihood there, or
    raises one of the project's errors or an arithmetic one.

    Parameters
    ----------
    problem : Problem
        Whose posterior it is.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self.evaluations = 0
        self.failures = 0
        self._low = np.full(len(problem.names), np.inf)
        self._high = np.full(len(problem.names), -np.inf)

    def __call__(self, vectors: FloatArray) -> FloatArray:
        """Log-posterior (m,) at scaled vectors (m, p)."""
        values = self.peek(vectors)
        self.evaluations += len(vectors)
        impossible = np.isneginf(values)
        if impossible.any():
            failed = vectors[impossible][np.isfinite(self._problem.log_prior(vectors[impossible]))]
            if len(failed):
                self.failures += len(failed)
                self._low = np.minimum(self._low, failed.min(axis=0))
                self._high = np.maximum(self._high, failed.max(axis=0))
        return values

    def peek(self, vectors: FloatArray) -> FloatArray:
        """Return the same without counting."""
        if len(vectors) > _TOGETHER:
            parts = np.array_split(vectors, -(-len(vectors) // _TOGETHER))
            return np.concatenate([self.peek(part) for part in parts])
        try:
            values = self._problem.log_posterior(vectors)
        except (UnderlayError, ArithmeticError, np.linalg.LinAlgError):
            # One of them broke the batch: find out which.
            if len(vectors) == 1:
                return np.array([-np.inf])
            return np.concatenate([self.peek(vector[None]) for vector in vectors])
        return np.where(np.isfinite(values), values, -np.inf)

    def continue_from(self, evaluations: int, failures: int) -> None:
        """Add what an earlier run counted."""
        self.evaluations += evaluations
        self.failures += failures

    def require_same(self, vectors: FloatArray, before: FloatArray) -> None:
        """Refuse a chain whose log-posterior `before` (m,) at `vectors` (m, p) is not that of this problem.

        Raises
        ------
        InputError
            If a value differs.
        """
        now = self.peek(vectors)
        if not np.allclose(now, before, rtol=1e-6, atol=_SAME_DENSITY):
            worst = int(np.argmax(np.abs(now - before)))
            raise InputError(
                "the file holds the chain of another problem: the log-posterior of its last step is "
                f"{before[worst]:.6g} there and {now[worst]:.6g} here; did the curve, a prior, the noise or "
                "the contact law change?"
            )

    @property
    def failure_region(self) -> dict[str, tuple[float, float]]:
        """Range (SI) of each parameter over the failures of this run; empty where there are none."""
        if not (self._low <= self._high).all():
            return {}
        low, high = self._problem.physical(self._low), self._problem.physical(self._high)
        return {name: (float(a), float(b)) for name, a, b in zip(self._problem.names, low, high, strict=True)}


def marginalised(problem: Problem) -> Problem:
    """Return the problem with noise and misfit averaged over in its likelihood.

    `sample` does this itself; a sampler of one's own takes `log_posterior` of what this returns. Correlated noise,
    a law that drifts with depth (where nothing of the shape is free also a layer that relaxes, or a base under a
    half-space), a force at contact and a baseline that creeps take part by their weights, on blocks of the curves,
    as they do in the intervals of `fit`.

    Parameters
    ----------
    problem : Problem
        What is sampled.

    Returns
    -------
    Problem
        The same where its noise is stated, is itself fitted, or leaves nothing to average (a curve without noise).

    Examples
    --------
    >>> import numpy as np
    >>> from underlay import Isotropic, Layer, LogUniform, Noise, Paraboloid, RIGID, Scene, synthesize
    >>> scene = Scene(Paraboloid(1e-3), Layer(Isotropic(1e6, 0.45), 1e-3), RIGID)
    >>> curve = synthesize(scene, np.linspace(-1e-5, 5e-5, 100), Noise(force=2e-4), rng=1)
    >>> problem = Problem(scene, curve, {"layer.E": LogUniform(1e4, 1e8)})
    >>> marginalised(problem).likelihood is None
    False
    >>> stated = problem.revised(noise=Noise())
    >>> marginalised(stated) is stated
    True
    """
    require_given(problem, "problem", Problem)
    if not problem.noise_is_open or problem.likelihood is not None:
        return problem
    try:
        averaged = averaged_fit(quick_fit(problem))
        return problem if averaged is None else problem.with_likelihood(MarginalLikelihood.of(averaged))
    except (FitError, InputError):
        # No optimum with a law about which anything could be averaged: the sampler itself says what is wrong.
        return problem
