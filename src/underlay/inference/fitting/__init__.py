"""What a least-squares fit is made of: its start, its objective, its noise, its result and its warnings."""
