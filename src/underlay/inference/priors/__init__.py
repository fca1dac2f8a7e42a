"""What is known of a parameter before the test: densities, bounds, and how they are written."""
