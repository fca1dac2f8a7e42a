"""Results for people: as sentences, tables, pictures, pages and files."""

import lazy_loader

# The pictures, and matplotlib with them, are loaded when they are asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["plots"])
