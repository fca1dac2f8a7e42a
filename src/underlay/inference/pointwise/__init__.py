"""The modulus depth by depth: what one curve says of the layer at each depth, beside what the fit says."""
