"""Floor 5: what people look at."""

import lazy_loader

# The pictures, and matplotlib with them, are loaded when they are asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["plots"])
