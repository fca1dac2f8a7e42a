"""Pictures: each function draws into ``ax=`` (or makes axes) and returns the axes; none opens a window.

The functions are those of `__init__.pyi`. Each module is loaded when one of its functions is first used: a picture
of a fit does not load the code for populations.
"""

import sys
from types import ModuleType

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


class _Pictures(ModuleType):
    """Module type of this package, which keeps functions from being replaced by modules of the same name.

    Python sets a loaded submodule as an attribute of its package, in place of the function.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in __all__ and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Pictures
