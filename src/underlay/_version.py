"""Which version of the program this is: said once, here; the build reads it too."""

__all__ = ["VERSION"]

VERSION = "0.1.0"
