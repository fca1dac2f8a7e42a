"""Floor 4: from a curve to a scene, with its uncertainty."""
