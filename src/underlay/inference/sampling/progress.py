"""A line that says how far a sampling is; silent when nobody looks."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

__all__ = ["SamplingProgress"]


class SamplingProgress:
    """Steps done, effective samples so far and time left, on the terminal.

    Parameters
    ----------
    total : int
        Most steps that will be taken.
    shown : bool or None
        None shows the line if standard error is a terminal.
    """

    def __init__(self, total: int, *, shown: bool | None) -> None:
        console = Console(stderr=True, force_terminal=shown or None)
        self._bar = Progress(
            TextColumn("sampling"),
            BarColumn(),
            TextColumn("{task.completed} of about {task.total} steps"),
            TextColumn("{task.fields[worth]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not (console.is_terminal if shown is None else shown),
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

    def judge(self, effective: float, needed: int) -> None:
        """Tell the effective samples so far and how many steps will probably be needed."""
        self._bar.update(self._task, total=needed, worth=f"{effective:.0f} effective samples")
