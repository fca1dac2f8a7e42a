"""The steps of the browser page, one module each."""
