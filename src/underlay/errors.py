"""The errors and warnings of underlay.

Everything raised on purpose derives from `UnderlayError` *and* from the builtin that fits, so that
``except ValueError`` and ``except OSError`` work as a caller expects.

==================  =============  ==================================================================
error               builtin        raised when
==================  =============  ==================================================================
InputError          ValueError     a value given by the caller is not allowed
MaterialError       InputError     elastic constants are not those of a stable material
UnitError           InputError     a unit is unknown or of the wrong dimension
ParameterError      InputError     a parameter path does not exist, or cannot act in this scene
RangeError          InputError     a law is asked outside the range in which it holds
CurveError          InputError     a curve cannot be used: too few points, NaN, no contact, ...
FileFormatError     InputError     a file was read but its content is not understood
FileAccessError     OSError        a file cannot be opened, read or written
LawError            RuntimeError   a solver or law of one's own does not keep to what it is
FitError            RuntimeError   an inference could not be carried out on valid input
SchedulerError      OSError        a Dask scheduler does not answer, or goes away
MissingExtraError   ImportError    an optional dependency is needed; says which extra brings it
==================  =============  ==================================================================
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager


class UnderlayError(Exception):
    """Base of every error raised on purpose."""


class InputError(UnderlayError, ValueError):
    """A value given by the caller is not allowed."""


class MaterialError(InputError):
    """Elastic constants that are not those of a stable material."""


class UnitError(InputError):
    """An unknown unit, or one of the wrong dimension."""


class ParameterError(InputError):
    """A parameter path that does not exist or has no effect in this scene."""


class RangeError(InputError):
    """A law evaluated outside the range in which it holds.

    Attributes
    ----------
    max_depth : float or None
        Largest indentation depth (m) that works, where there is one.
    """

    def __init__(self, message: str, *, max_depth: float | None = None) -> None:
        super().__init__(message)
        self.max_depth = max_depth


class CurveError(InputError):
    """A curve that cannot be used as it is."""


class FileFormatError(InputError):
    """A file whose content is not understood."""


class FileAccessError(UnderlayError, OSError):
    """A file that cannot be opened, read or written."""


class LawError(UnderlayError, RuntimeError):
    """A solver or law that fails, or returns NaN or the wrong shape."""


class FitError(UnderlayError, RuntimeError):
    """An inference that could not be carried out on valid input."""


class SchedulerError(UnderlayError, OSError):
    """A Dask scheduler that does not answer, has no usable workers, or is lost."""


class MissingExtraError(UnderlayError, ImportError):
    """An optional dependency is needed and absent."""


def installing(extra: str) -> str:
    """Return the pip command that installs an extra from the source folder."""
    return f"pip install '.[{extra}]' in the folder of underlay"


def missing_extra(need: str, extra: str, otherwise: str = "") -> MissingExtraError:
    """Return the error for a library that is not installed.

    Parameters
    ----------
    need : str
        What needs which library, e.g. ``"an Excel file needs xlsxwriter"``.
    extra : str
        Name of the extra that contains it.
    otherwise : str
        What else the reader can do.

    Returns
    -------
    MissingExtraError
        With the command that installs the extra.
    """
    return MissingExtraError(f"{need}: {installing(extra)}{otherwise and f', or {otherwise}'}")


class UnderlayWarning(UserWarning):
    """A warning about a valid result with a reservation that the caller should know."""


@contextmanager
def gathered_warnings() -> Iterator[list[str]]:
    """Collect this package's warnings inside a ``with`` block into the list it gives; others are raised after it.

    The list is filled when the block ends.
    """
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UnderlayWarning)
        yield texts
    for entry in caught:
        if issubclass(entry.category, UnderlayWarning):
            texts.append(str(entry.message))
        else:
            warnings.warn_explicit(entry.message, entry.category, entry.filename, entry.lineno)
