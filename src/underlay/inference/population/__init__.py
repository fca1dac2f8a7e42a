"""Population statistics from many curves: means, spreads between animals and within, ratios of groups."""
