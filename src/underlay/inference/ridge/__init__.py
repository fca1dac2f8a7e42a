"""A frozen mixture laid along the ridges of a posterior: what proposes to a chain, and what weighs draws alone."""
