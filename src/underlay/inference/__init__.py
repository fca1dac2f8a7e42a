"""Floor 4: from a curve and a scene to numbers, each with how sure it is."""
