"""What else the residuals of a fit may be: correlated noise, a law that drifts, a force that jumps at contact."""
