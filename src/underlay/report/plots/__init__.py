"""Pictures: each function takes ``ax=`` (or makes one), draws, and returns the axes; none shows a window.

The functions are those of `__init__.pyi`. Each is loaded when it is first asked for: a picture of a fit loads
neither populations nor what they compute with.
"""

import sys
from types import ModuleType

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


class _Pictures(ModuleType):
    """The package, whose pictures are functions although the files that draw them have their names.

    Loading such a file would set it as an attribute of this module, in place of the function.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in __all__ and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Pictures
