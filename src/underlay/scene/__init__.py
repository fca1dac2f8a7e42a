"""Floor 2: one indentation test, declared."""
