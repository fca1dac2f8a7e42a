"""Design of a test: what it determines, which test would, and which second test to add."""
