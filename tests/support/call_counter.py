"""Counts calls of a function or method while a test runs, without changing what it does."""

from __future__ import annotations

from dataclasses import dataclass

import pytest


@dataclass
class Counter:
    """Calls seen so far."""

    calls: int = 0


def count_calls(monkeypatch: pytest.MonkeyPatch, owner: object, *names: str) -> Counter:
    """Count the calls of `names` of a module or class; the one counter adds them up."""
    counter = Counter()
    for name in names:
        original = getattr(owner, name)

        def counted(*args, _original=original, **keywords):
            counter.calls += 1
            return _original(*args, **keywords)

        monkeypatch.setattr(owner, name, counted)
    return counter
