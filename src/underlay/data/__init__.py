"""Floor 3: measured and made curves."""
