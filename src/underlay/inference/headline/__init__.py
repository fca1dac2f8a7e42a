"""What a fit states to people: `statements.py` is the way in."""
