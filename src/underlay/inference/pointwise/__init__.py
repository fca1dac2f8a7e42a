"""The layer's modulus at each depth of one curve, for comparison with the modulus of the fit."""
