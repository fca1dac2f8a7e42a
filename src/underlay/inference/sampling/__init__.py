"""Posteriors by emcee: starting points of the walkers, length of the run, stored draws and their diagnostics."""
