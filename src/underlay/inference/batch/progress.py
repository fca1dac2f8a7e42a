"""A line that says how far a map is; silent when nobody looks."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Self, TypeAlias

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

__all__ = ["MapProgress", "Told"]

#: Told how many curves are done, and how many there are.
Told: TypeAlias = Callable[[int, int], None]


class _Speed(ProgressColumn):
    """Curves per second."""

    def render(self, task: Task) -> Text:
        """Text of the column."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.3g} curves/s")


class MapProgress:
    """Curves done, curves per second and time left, on the terminal.

    Parameters
    ----------
    total, done : int
        Curves of the map, and those that were there before.
    shown : bool, callable or None
        None shows the line if standard error is a terminal; a function is called with the curves done and all
        curves instead.
    """

    def __init__(self, total: int, done: int, *, shown: bool | Told | None) -> None:
        self._told: Told | None = None if isinstance(shown, bool) else shown
        self._done, self._total = done, total
        console = Console(stderr=True)
        self._bar = Progress(
            TextColumn("fitting"),
            BarColumn(),
            TextColumn("{task.completed} of {task.total} curves"),
            _Speed(),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not (console.is_terminal if shown is None else shown is True),
            refresh_per_second=4,
        )
        self._task = self._bar.add_task("fitting", total=total, completed=done)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Stopping prints a line even where nothing was shown, in versions of rich up to 14.
        if not self._bar.disable:
            self._bar.stop()

    def advance(self, count: int) -> None:
        """Tell that `count` more curves are done."""
        self._bar.advance(self._task, count)
        self._done += count
        if self._told is not None:
            self._told(self._done, self._total)
