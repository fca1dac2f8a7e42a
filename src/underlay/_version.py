"""The version of the program, which the build reads too."""

VERSION = "0.1.0"
