"""Errors of one size in several curves: what one law gets wrong, it gets wrong in all of them.

The readings of all curves over their noise, each whitened by its own, are e = z + A u, z and u independent and of
unit variance, the rows of A those of the curves one after the other. With A = U S V' their covariance is I + A A',
whose inverse root is

    P = I - U (1 - (1 + S^2)^(-1/2)) U',

and half the logarithm of whose determinant is sum ln(1 + s^2) / 2. A depends on no parameter: sizes are over the
noise, and that is stated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.members import Member
from underlay.scene.low_rank_noise import LowRankNoise

__all__ = ["CommonErrors"]


@dataclass(frozen=True)
class CommonErrors:
    """Errors that the curves of a problem have in common.

    Parameters
    ----------
    rows : tuple of FloatArray
        Of every curve, (n, m): what each error of size one adds to its whitened readings.
    directions : tuple of FloatArray
        Of every curve its rows of U, (n, m).
    sizes : FloatArray
        S, (m,).
    """

    rows: tuple[FloatArray, ...]
    directions: tuple[FloatArray, ...]
    sizes: FloatArray

    @classmethod
    def of(cls, members: Sequence[Member]) -> CommonErrors | None:
        """Those of the noise of these curves; None where there are none.

        Raises
        ------
        InputError
            If some curves have other numbers of them than others.
        """
        columns = [_common(member) for member in members]
        counts = {own.shape[1] for own in columns}
        if counts == {0}:
            return None
        if len(counts) > 1:
            raise InputError(
                "errors that curves have in common are of one size in all of them: give each curve as many "
                f"columns; got {', '.join(str(own.shape[1]) for own in columns)}"
            )
        rows = [
            member.noise.whiten(own.T, member.curve.time).T
            for member, own in zip(members, columns, strict=True)
        ]
        ends = np.cumsum([len(own) for own in rows])[:-1]
        directions, sizes, _ = np.linalg.svd(np.concatenate(rows), full_matrices=False)
        return cls(tuple(rows), tuple(np.split(directions, ends)), sizes)

    @property
    def log_determinant(self) -> float:
        """Half the logarithm of the determinant of I + A A'."""
        return 0.5 * float(np.log1p(self.sizes**2).sum())

    def whitened(self, parts: Sequence[FloatArray]) -> list[FloatArray]:
        """What each curve's noise has whitened, (..., n) each, whitened of what they have in common too."""
        together = sum(own @ along for own, along in zip(parts, self.directions, strict=True))
        less = together * (1.0 - 1.0 / np.sqrt(1.0 + self.sizes**2))
        return [own - less @ along.T for own, along in zip(parts, self.directions, strict=True)]

    def log_density(self, along: FloatArray) -> FloatArray:
        """What they add to the log-likelihood, (...), at whitened readings along the directions, (..., m)."""
        share = self.sizes**2 / (1.0 + self.sizes**2)
        return np.asarray(0.5 * np.square(along) @ share - self.log_determinant)

    def innovations(self, white: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Whitened readings of all curves (..., n) less what those before say, and ln of their deviations."""
        noise = LowRankNoise(force=1.0, columns=np.concatenate(self.rows))
        return noise.whiten(white), noise.log_deviations(np.ones(white.shape[-1]))


def _common(member: Member) -> FloatArray:
    noise = member.noise
    return noise.common if isinstance(noise, LowRankNoise) else np.zeros((len(member.force), 0))
