"""What many curves say of the population that they come from."""
