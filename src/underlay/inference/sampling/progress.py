"""A line that says how far a sampling is; silent when nobody looks."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Self, TypeAlias

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

__all__ = ["SamplingProgress", "Told"]

#: Told the steps that are done, those that will probably be needed, and the effective samples so far.
Told: TypeAlias = Callable[[int, int, float], None]


class SamplingProgress:
    """Steps done, effective samples so far and time left, on the terminal.

    Parameters
    ----------
    total : int
        Most steps that will be taken.
    shown : bool, callable or None
        None shows the line if standard error is a terminal; a function is called with the steps done, those that
        will probably be needed and the effective samples so far instead.
    """

    def __init__(self, total: int, *, shown: bool | Told | None) -> None:
        self._told: Told | None = None if isinstance(shown, bool) else shown
        self._total, self._effective = total, 0.0
        console = Console(stderr=True, force_terminal=(shown is True) or None)
        self._bar = Progress(
            TextColumn("sampling"),
            BarColumn(),
            TextColumn("{task.completed} of about {task.total} steps"),
            TextColumn("{task.fields[worth]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not (console.is_terminal if shown is None else shown is True),
            refresh_per_second=4,
        )
        self._task = self._bar.add_task("sampling", total=total, worth="")

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Stopping prints a line even where nothing was shown, in versions of rich up to 14.
        if not self._bar.disable:
            self._bar.stop()

    def step(self, done: int) -> None:
        """Tell that `done` steps are done."""
        self._bar.update(self._task, completed=done)
        if self._told is not None:
            self._told(done, self._total, self._effective)

    def judge(self, effective: float, needed: int) -> None:
        """Tell the effective samples so far and how many steps will probably be needed."""
        self._total, self._effective = needed, effective
        self._bar.update(self._task, total=needed, worth=f"{effective:.0f} effective samples")
