"""Parts of the profile likelihood; the public function is in `profile.py`."""
