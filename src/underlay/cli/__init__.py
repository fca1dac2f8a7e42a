"""The command line: commands that call the library; `main` is the entry point."""

from underlay.cli.app import main

__all__ = ["main"]
