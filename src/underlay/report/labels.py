"""What parameters are called in a sentence."""

from __future__ import annotations

import re

__all__ = ["is_of_the_sample", "label", "start"]

# Parameters are paths: words, dots, and the number of a curve. What else a file may hold in place of one could
# mean something to Markdown, or to the formulas of a picture.
_FOREIGN = re.compile(r"[^\w.\[\]]", re.ASCII)
_OF_CURVE = re.compile(r"(?P<path>.+)\[(?P<number>\d{1,6})\]")
#: What the parameters are called in a sentence.
_LABELS = {
    "layer.E": "layer modulus",
    "layer.E_axial": "axial modulus of the layer",
    "layer.G_axial": "axial shear modulus of the layer",
    "layer.nu": "Poisson's ratio of the layer",
    "layer.thickness": "layer thickness",
    "layer.reduced_modulus": "reduced modulus of the layer",
    "layer.oedometric_modulus": "oedometric modulus of the layer",
    "substrate.E": "substrate modulus",
    "substrate.nu": "Poisson's ratio of the substrate",
    "indenter.radius": "indenter radius",
    "indenter.half_angle": "half-angle of the indenter",
    "instrument.contact_depth": "contact point",
    "instrument.baseline": "baseline",
    "instrument.baseline_slope": "baseline slope",
    "instrument.compliance": "instrument compliance",
    "noise.force": "noise of the force",
    "noise.relative": "relative noise",
    "noise.correlation_time": "correlation time of the noise",
    "noise.depth": "noise of the depth",
    "stiffness": "contact stiffness at the deepest point",
}


def label(name: str) -> str:
    """Return what a parameter is called in a sentence: ``"layer.E[1]"`` -> ``"layer modulus (curve 2)"``.

    ``"layer.E.stderr"``, a column of a map, is the ``"standard error of the layer modulus"``.
    """
    if name.endswith(".stderr"):
        return f"standard error of the {label(name.removesuffix('.stderr'))}"
    of_curve = _OF_CURVE.fullmatch(name)
    path = of_curve["path"] if of_curve else name
    words = _LABELS.get(path) or _FOREIGN.sub("?", path)
    return f"{words} (curve {int(of_curve['number']) + 1})" if of_curve else words


def is_of_the_sample(name: str) -> bool:
    """Return whether a parameter is one of the specimen or the tip, not of the instrument or its noise."""
    return not name.startswith(("instrument.", "noise."))


def start(text: str) -> str:
    """Return `text` as it begins a sentence."""
    return text[:1].upper() + text[1:]
