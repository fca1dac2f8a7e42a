"""The open benchmark of layered indentation: curves with their truth, and what any estimate of a modulus scores.

`cases` reads what stands in data_samples/benchmark; `estimates` are the ways to a modulus: our fit, one contact
law, another program; `scores` compares with the truth; `references` compares a law with the exact contact problem
and with finite elements. (What a law or a fit costs in time is measured by `report/bench`, not here.)
"""
