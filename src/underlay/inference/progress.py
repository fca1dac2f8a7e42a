"""The progress line of long work, on standard error, or the caller's own function in its place."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import Progress, ProgressColumn


class ProgressLine:
    """A progress line of one task; a context manager.

    Parameters
    ----------
    columns : ProgressColumn
        What the line shows, from left to right.
    shown : bool, callable or None
        None shows the line if standard error is a terminal, True anywhere. A function is called in its place.
    task : keyword arguments
        The task's ``total`` and further fields, as rich takes them.
    """

    def __init__(
        self, *columns: ProgressColumn, shown: bool | Callable[..., None] | None, **task: Any
    ) -> None:
        self._report = None if isinstance(shown, bool) else shown
        console = Console(stderr=True, force_terminal=(shown is True) or None)
        self._bar = Progress(
            *columns,
            console=console,
            transient=True,
            disable=not (console.is_terminal if shown is None else shown is True),
            refresh_per_second=4,
        )
        self._task = self._bar.add_task("", **task)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Stopping prints a line even where nothing was shown, in versions of rich up to 14.
        if not self._bar.disable:
            self._bar.stop()

    def show(self, *told: float, **fields: Any) -> None:
        """Show new values of the task's `fields`, or call the caller's function with the numbers `told`."""
        self._bar.update(self._task, **fields)
        if self._report is not None:
            self._report(*told)
