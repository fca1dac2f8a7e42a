"""Many curves in one table: who works (processes, Dask), what is written, and how a run goes on."""
