"""The declaration of one indentation test: tip, layer, substrate, instrument, noise."""
