"""Loaded last into the process whose forks are the page's workers: what it holds is never collected.

A collection writes into every object that it looks at, and a fork gets a copy of its own of all that is
written.
"""

import gc

gc.collect()
gc.freeze()
