"""Loaded last into the process from which the page's workers are forked: freezes its objects for the collector.

A garbage collection writes into every object it visits, and a fork gets its own copy of each memory page that is
written.
"""

import gc

gc.collect()
gc.freeze()
