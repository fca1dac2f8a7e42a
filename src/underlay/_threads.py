"""Runs linear algebra on one thread during solving, fitting and sampling.

The matrices are small. More threads gain nothing on idle cores, and on busy ones they wait for one another: with
one other busy process on two cores the interval of a film's modulus took 8 s instead of 1 (`tests/test_threads.py`
checks that no more threads are used).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import scipy.linalg  # noqa: F401  brings scipy's own linear algebra, so that the pools below are all there are
from threadpoolctl import ThreadpoolController

_POOLS = ThreadpoolController().select(user_api="blas").lib_controllers


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit linear algebra to one thread inside, and restore the number afterwards; a context or a decorator."""
    before = [(pool, pool.get_num_threads()) for pool in _POOLS]
    several = [(pool, threads) for pool, threads in before if threads and threads > 1]
    for pool, _ in several:
        pool.set_num_threads(1)
    try:
        yield
    finally:
        for pool, threads in several:
            pool.set_num_threads(threads)
