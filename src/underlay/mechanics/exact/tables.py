"""Tables of master curves, kept for the whole process: the one store of the package that outlives its callers.

A table is a pure function of its key (exponent, Poisson's ratios, cell, tolerance): it holds nothing of a caller,
and whoever asks first pays its 10 to 50 ms for all who ask later. A store owned by a solver or a problem would be
made anew for every fit of a series, since ``solver="auto"`` names a solver and holds none. So there is one, of
bounded size, and `tests/test_house.py` holds that there is no other.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Any, TypeVar

__all__ = ["TABLES", "TableStore"]

Table = TypeVar("Table")


class TableStore:
    """The tables used last; safe for threads, of which two may at most build one table twice.

    Parameters
    ----------
    most : int
        Tables kept.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = Lock()

    def __len__(self) -> int:
        return len(self._kept)

    def get(self, key: Hashable, build: Callable[[], Table]) -> Table:
        """Return the table of a key, built where there is none; the key must say all that it depends on."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                table: Table = self._kept[key]
                return table
        return self.put(key, build())

    def put(self, key: Hashable, table: Table) -> Table:
        """Keep a table in place of the one of that key."""
        with self._lock:
            self._kept[key] = table
            self._kept.move_to_end(key)
            if len(self._kept) > self._most:
                self._kept.popitem(last=False)
        return table


#: A table has up to some 100 kB, most have 10.
TABLES = TableStore(4096)
