"""The calibration that a file of AFM Workshop states, which afmformats drops where another is given."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection

__all__ = ["workshop_calibration"]

# The maker's names, and what makes SI of their numbers: nN/nm is N/m; mV/nm is the inverse of a sensitivity.
_KEYS: dict[str, tuple[str, Callable[[float], float]]] = {
    "spring constant": ("Force Constant, nN/nm", float),
    "sensitivity": ("Light Lever Gain, mV/nm", lambda gain: 1e-6 / gain),
}
# What the maker's program writes where nothing was calibrated.
_UNSET = 1.0


def workshop_calibration(text: str, names: Collection[str]) -> dict[str, float]:
    """SI numbers (N/m, m/V) of those `names` that the header of a file states."""
    found = {}
    for name in names:
        key, in_si = _KEYS[name]
        match = re.search(rf"^{re.escape(key)}:\s*([0-9.eE+-]+)\s*$", text, re.MULTILINE)
        value = _UNSET if match is None else float(match[1])
        if value > 0.0 and value != _UNSET:
            found[name] = in_si(value)
    return found
