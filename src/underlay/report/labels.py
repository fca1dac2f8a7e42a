"""Names of parameters for people: in a sentence and in a formula."""

from __future__ import annotations

import re
from collections.abc import Sequence

from underlay.inference.sampling.derived import DERIVED
from underlay.quantities import curve_of, path_of
from underlay.scene.parameters import declared

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

    A column of a map such as ``"layer.E.stderr"`` gives ``"standard error of the layer modulus"``.
    """
    if name.endswith(".stderr"):
        return f"standard error of the {label(name.removesuffix('.stderr'))}"
    path, curve = path_of(name), curve_of(name)
    words = _words(path)
    return words if curve is None else f"{words} (curve {curve + 1})"


def labelled(text: str) -> str:
    """Return `text` with each parameter path replaced by its name: ``"layer.E is"`` -> ``"layer modulus is"``."""
    return _PATHS.sub(lambda found: label(found[0]), text)


def _words(path: str) -> str:
    place, _, last = path.rpartition(".")
    known = DERIVED.get(last) or declared(path)
    if not known.label:
        return _FOREIGN.sub("?", path)
    number = _INDEX.search(last)
    # The part of a scene that the path leads to: "layer"; "layer 2" of "substrate.layers[0]".
    part, _, inner = _FOREIGN.sub("?", place).partition(".")
    deeper = _INDEX.search(inner)
    words = known.label.format(part=f"layer {int(deeper[1]) + 2}" if deeper else part)
    return f"{words} (term {int(number[1]) + 1})" if number else words


def symbol(name: str) -> str:
    """Return the letter of a parameter in TeX, or its path in upright type where it has none.

    Letters of the substrate have the subscript 2, entries of a list their number as subscript, and parameters of a
    single curve the curve's number as superscript.
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


def listed(names: Sequence[str]) -> str:
    """Return names as a list in a sentence: ``"a, b and c"``."""
    *first, last = names or ("nothing",)
    return f"{', '.join(first)} and {last}" if first else last


def is_of_the_sample(name: str) -> bool:
    """Return whether a parameter describes specimen, tip or adhesion, not the instrument, noise or model error."""
    return not name.startswith(("discrepancy.", "instrument.", "lever.", "noise."))


def start(text: str) -> str:
    """Return `text` with a capital first letter, as it begins a sentence."""
    return text[:1].upper() + text[1:]
