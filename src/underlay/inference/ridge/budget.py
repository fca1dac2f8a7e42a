"""How much processor time a search may take: a law away from the data may cost a thousand times one near them."""

from __future__ import annotations

import time

__all__ = ["Budget", "OutOfTimeError"]


class OutOfTimeError(Exception):
    """The processor time that was given is used up; caught where the search began."""


class Budget:
    """Processor seconds from now on.

    Parameters
    ----------
    seconds : float
        Of this process.
    """

    def __init__(self, seconds: float) -> None:
        self._begin, self._seconds = time.process_time(), seconds

    @property
    def used(self) -> float:
        """Seconds used so far."""
        return time.process_time() - self._begin

    @property
    def left(self) -> bool:
        """Whether there is any left."""
        return self.used < self._seconds

    def require(self) -> None:
        """Go on.

        Raises
        ------
        OutOfTimeError
            If the time is used up.
        """
        if not self.left:
            raise OutOfTimeError
