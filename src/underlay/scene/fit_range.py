"""The range of a curve that is fitted, in the form that people write: ``"10 % of force"``, ``"0.5 radius"``."""

from __future__ import annotations

import re
from dataclasses import dataclass

from underlay.errors import InputError
from underlay.units import format_quantity, parse_quantity

#: Entry of a curve's metadata: depths (m) and forces (N) of the deepest quarter of what lies beyond a fit range.
BEYOND = "beyond_the_range"
# Quantities of which an end of a range may be a share or a multiple, and the pattern of such an end.
_OF = ("force", "depth", "thickness", "radius")
_RELATIVE = re.compile(
    rf"\s*(\d+\.?\d*|\.\d+)\s*(%)?\s*(?:of|times|x)?\s*(?:the\s+)?({'|'.join(_OF)})\s*", re.IGNORECASE
)
_LENGTH = "length"
_ALLOWED = (
    'write "10 % of force", "50 % of depth", "10 % of thickness", "0.5 radius" or a length such as "2 um"'
)


@dataclass(frozen=True)
class Mark:
    """One end of a range.

    Parameters
    ----------
    value : float
        Share of the largest force, of the largest depth since contact, multiple of the layer's thickness or of the
        indenter's radius; or a depth since contact (m).
    of : str
        ``"force"``, ``"depth"``, ``"thickness"``, ``"radius"`` or ``"length"``.

    Examples
    --------
    >>> Mark.parse("10 % of force"), Mark.parse("0.5 radius")
    (Mark(value=0.1, of='force'), Mark(value=0.5, of='radius'))
    >>> str(Mark.parse("16 % of the radius"))
    '16 % of radius'
    """

    value: float
    of: str

    @classmethod
    def parse(cls, given: object) -> Mark:
        """Read an end of a fit range from text such as "10 % of force"; a `Mark` is returned as it is.

        Raises
        ------
        InputError
            If it is no end of a range.
        """
        if isinstance(given, Mark):
            return given
        if not isinstance(given, str):
            raise InputError(f"an end of the fit range is text: {_ALLOWED}; got {given!r:.60}")
        matched = _RELATIVE.fullmatch(given)
        if matched is None:
            try:
                value = parse_quantity(given, _LENGTH)
            except InputError as error:
                raise InputError(f"an end of the fit range: {_ALLOWED}; got {given!r:.60}") from error
            return cls(value, _LENGTH)
        number, percent, of = matched.groups()
        value, of = float(number) * (0.01 if percent else 1.0), of.lower()
        if of in ("force", "depth") and not value <= 1.0:
            raise InputError(f"no more than 100 % of the {of} was measured; got {given!r:.60}")
        return cls(value, of)

    def __str__(self) -> str:
        if self.of == _LENGTH:
            return format_quantity(self.value, _LENGTH)
        return f"{100.0 * self.value:.6g} % of {self.of}"


@dataclass(frozen=True)
class FitRange:
    """The range over which a curve is fitted; None for an end means the end of the curve.

    Parameters
    ----------
    low, high : Mark or None
        The ends. Without a low one the points before contact are kept.
    """

    low: Mark | None = None
    high: Mark | None = None

    @classmethod
    def of(cls, low: object = None, high: object = None) -> FitRange:
        """Make a range from two ends as people write them; see `Mark.parse`."""
        return cls(*(None if end is None else Mark.parse(end) for end in (low, high)))

    def __bool__(self) -> bool:
        return self.low is not None or self.high is not None

    def __str__(self) -> str:
        ends = (("from", self.low), ("to", self.high))
        return " ".join(f"{word} {end}" for word, end in ends if end is not None)


#: Default fit ranges of instruments' software, by name, as stated in their files.
PRESETS = {"bioindenter": FitRange(Mark(0.10, "force"), Mark(0.98, "force"))}
