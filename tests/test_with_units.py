"""Tables for reading: every number in the unit of its size, and the numbers kept in the table that was given."""

import numpy as np
import pandas as pd

import underlay as ul
from support.reports import small_posterior


def test_a_summary_reads_in_units_and_keeps_what_has_none():
    summary = small_posterior()[1].summary(derived=True)
    table = ul.with_units(summary)
    assert list(table.index) == list(summary.index)
    assert table.loc["layer.E", "median"].endswith(" MPa")
    assert table.loc["instrument.contact_depth", "mcse"].split()[-1] in ("nm", "µm")
    assert float(table.loc["layer.E", "ess"]) == float(f"{summary.loc['layer.E', 'ess']:.4g}")
    assert not table.map(lambda cell: "e+0" in cell).any().any()
    assert summary.loc["layer.E", "median"] > 1e5


def test_a_map_reads_in_units_by_its_columns():
    table = pd.DataFrame(
        {
            "name": ["a"],
            "layer.E": [6.2e5],
            "layer.E.stderr": [1.1e4],
            "x": [0.5],
            "rms": [np.nan],
            "seconds": [2],
        }
    )
    row = ul.with_units(table).iloc[0]
    assert list(row) == ["a", "0.62 MPa", "11 kPa", "0.5", "", "2"]
