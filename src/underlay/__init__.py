"""underlay: the stiffness of a thin layer from an indentation curve, with the substrate in the model.

The public names are those of `__init__.pyi`. Each is loaded at its first use: `import underlay` costs milliseconds,
and a script that only computes a contact law never loads a fitting library (PEP 562).
"""

import sys
from types import ModuleType

import lazy_loader

from underlay._version import VERSION

__version__ = VERSION

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


class _Underlay(ModuleType):
    """The package's module class, in which `report` is the function although a subpackage has that name too.

    Loading the subpackage would set it as an attribute of this module, in place of the function.
    """

    @property
    def report(self) -> object:
        from underlay.report.render import report  # noqa: PLC0415  loaded when it is asked for

        return report

    @report.setter
    def report(self, module: ModuleType) -> None:
        pass


sys.modules[__name__].__class__ = _Underlay
