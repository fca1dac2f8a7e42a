"""The cases of the README's table, one by one.

Run with `python -m pytest tests/benchmarks --benchmark-enable`. `underlay bench` times the same cases against
the explicit formula. Nothing here asserts seconds.
"""

import numpy as np
import pytest

from underlay.report.bench import CASES


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_case(benchmark, case):
    benchmark(case.prepare(np.linspace(1.8e-6, 1.8e-3, 1000)))
