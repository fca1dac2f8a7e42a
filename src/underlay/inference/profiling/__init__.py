"""Parts of a profile likelihood; `profiles.py` is the way in."""
