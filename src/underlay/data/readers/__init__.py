"""Readers: one file per instrument format."""
