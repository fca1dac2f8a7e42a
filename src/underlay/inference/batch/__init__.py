"""Fits of many curves into one table: worker processes or Dask, the journal of a run, and its continuation."""
