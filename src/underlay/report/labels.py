"""What parameters are called in a sentence and in a formula."""

from __future__ import annotations

import re

from underlay.inference.sampling.derived import DERIVED
from underlay.quantities import curve_of, path_of
from underlay.scene.parameters import declared

__all__ = ["is_of_the_sample", "label", "labelled", "start", "symbol"]

# Parameters are paths: words, dots, and numbers in brackets. What else a file may hold in place of one could mean
# something to Markdown, or to the formulas of a picture.
_FOREIGN = re.compile(r"[^\w.\[\]]", re.ASCII)
_INDEX = re.compile(r"\[(\d{1,6})\]$")
_PATHS = re.compile(
    r"(?<![\w.])(?:layer|substrate|indenter|instrument|lever|adhesion|noise|discrepancy|history)"
    r"\.[A-Za-z_]\w*(?:\.[A-Za-z_]\w*|\[\d+\])*"
)


def label(name: str) -> str:
    """Return what a parameter is called in a sentence: ``"layer.E[1]"`` -> ``"layer modulus (curve 2)"``.

    ``"layer.E.stderr"``, a column of a map, is the ``"standard error of the layer modulus"``.
    """
    if name.endswith(".stderr"):
        return f"standard error of the {label(name.removesuffix('.stderr'))}"
    path, curve = path_of(name), curve_of(name)
    words = _words(path)
    return words if curve is None else f"{words} (curve {curve + 1})"


def labelled(text: str) -> str:
    """Return `text` with parameters called by their words: ``"layer.E is ..."`` -> ``"layer modulus is ..."``."""
    return _PATHS.sub(lambda found: label(found[0]), text)


def _words(path: str) -> str:
    place, _, last = path.rpartition(".")
    known = DERIVED.get(last) or declared(path)
    if not known.label:
        return _FOREIGN.sub("?", path)
    number = _INDEX.search(last)
    words = known.label.format(part=_part(_FOREIGN.sub("?", place)))
    return f"{words}, number {int(number[1]) + 1}" if number else words


def _part(place: str) -> str:
    """What a part is called: ``"layer"``; ``"substrate.layers[0]"`` is layer 2, from the top."""
    whole, _, inner = place.partition(".")
    number = _INDEX.search(inner)
    return f"layer {int(number[1]) + 2}" if number else whole


def symbol(name: str) -> str:
    """Return the letter of a parameter in a formula (TeX); its path where it has none.

    The substrate's letters carry a 2, as the paper's do, those of a list its number, and those of a single curve
    that of the curve.
    """
    path, curve = path_of(name), curve_of(name)
    letter, number = declared(path).symbol, _INDEX.search(path)
    if not letter:
        letter = r"\mathrm{" + _FOREIGN.sub("?", path).replace("_", r"\_") + "}"
    elif number:
        letter = f"{letter}_{{{int(number[1]) + 1}}}"
    elif path.startswith("substrate."):
        letter = f"{letter}_2"
    return letter if curve is None else f"{letter}^{{({curve + 1})}}"


def is_of_the_sample(name: str) -> bool:
    """Return whether a parameter is one of the specimen or the tip, not of the instrument or its noise."""
    return not name.startswith(("discrepancy.", "instrument.", "lever.", "noise."))


def start(text: str) -> str:
    """Return `text` as it begins a sentence."""
    return text[:1].upper() + text[1:]
