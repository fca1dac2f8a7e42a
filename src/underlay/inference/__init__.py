"""Inference: from a curve and a scene to fitted numbers, each with its uncertainty."""
