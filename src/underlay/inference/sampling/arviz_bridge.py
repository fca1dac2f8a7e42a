"""arviz, the one place it is imported: for the export of a posterior and for comparisons."""

from __future__ import annotations

import warnings
from types import ModuleType

from underlay.errors import MissingExtraError

__all__ = ["arviz_library"]


def arviz_library() -> ModuleType:
    """Import arviz.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return _imported()
    except FileNotFoundError:
        # arviz notes in the user's cache on which day it last warned. Where two processes import it at the same
        # moment, the one that comes second finds its draft of that note gone; by then the note is in its place.
        return _imported()


def _imported() -> ModuleType:
    try:
        with warnings.catch_warnings():
            # arviz announces its next major version at import, which is not the caller's concern.
            warnings.simplefilter("ignore", FutureWarning)
            import arviz  # noqa: PLC0415  # an optional extra
    except ImportError as error:
        raise MissingExtraError("this needs arviz: install underlay[uq]") from error
    module: ModuleType = arviz
    return module
