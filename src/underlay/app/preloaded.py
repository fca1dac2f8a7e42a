"""Loaded last into the process that the page's workers are forks of: its objects are taken out of garbage collection.

A collection writes into every object that it looks at, and a fork gets a copy of its own of all that is written.
"""

import gc

gc.collect()
gc.freeze()
