"""Parts of the profile likelihood; the public functions are in `profiles.py`."""
