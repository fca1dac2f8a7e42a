"""Measured and synthetic curves: reading, contact point, segments, and whether they can be fitted."""
