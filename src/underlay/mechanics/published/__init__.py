"""Corrections from the literature, to reproduce results obtained with them and to see their error.

One correction, one entry of ``corrections.toml``: equation, assumptions, range, source, measured error; and its
function in `formulas` where it is more than a polynomial. To add one: an entry, and its function.
"""
