"""Thickness under the curves of an analysis, from contact heights (`data/contact_heights.py`), in its manifest."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from underlay.app.folder import AnalysisFolder
from underlay.app.labels import BARE, read_labels, write_labels
from underlay.data.contact_heights import thickness_of_heights
from underlay.data.contact_point import find_contact
from underlay.errors import InputError
from underlay.inference.from_files import read_whole
from underlay.report.tables import span
from underlay.scene.scene_file import SceneFile
from underlay.units import format_quantity, parse_quantity, printed

__all__ = ["thickness_from_heights"]

_THICKNESS = "thickness (m)"
_PLACE = re.compile(r"([xy])\s*[(\[]\s*(\w+)\s*[)\]]")


def thickness_from_heights(folder: AnalysisFolder, file: SceneFile, begins: str) -> str:
    """Write the layer thickness under every curve into the manifest, from contacts with the bare substrate.

    The surface of the substrate is a plane through the contacts of at least three curves on it, if all curves have
    positions and these are not on a line; otherwise it is taken as level. The stated error includes the contact
    points alone.

    Parameters
    ----------
    folder : AnalysisFolder
        Holds the curves, and their positions where labels or files give some.
    file : SceneFile
        How curves are read; its contact model is used to find the contact point of curves on the sample.
    begins : str
        Beginning of the names of the curves on the bare substrate.

    Returns
    -------
    str
        A sentence on the thicknesses found, for the page.

    Raises
    ------
    InputError
        If no curve has such a name, or all have, or the sample would be below the substrate.
    CurveError
        If a curve shows no contact.
    """
    rows = read_labels(folder)
    names = list(rows)
    bare = np.array([bool(begins) and name.casefold().startswith(begins.casefold()) for name in names])
    if not bare.any() or bare.all():
        raise InputError(
            f"{bare.sum()} of {len(rows)} curves have a name that begins with {begins[:40]!r}: some must be on the "
            "bare substrate, and some on the sample"
        )
    found = [
        _contact(folder, file, name, rows[name], on_sample=not alone)
        for name, alone in zip(names, bare, strict=True)
    ]
    height, error = (np.array([contact[part] for contact in found]) for part in (0, 1))
    known = thickness_of_heights(height, error, bare, [contact[2] for contact in found])
    if (known.thickness[~bare] <= 0.0).any():
        deepest = names[int(np.argmin(np.where(bare, np.inf, known.thickness)))]
        raise InputError(
            f"{deepest} meets the sample deeper than the bare substrate: do all curves count depth from one zero?"
        )
    for name, alone, value in zip(names, bare, known.thickness, strict=True):
        kept = {key: cell for key, cell in rows[name].items() if "thickness" not in key}
        rows[name] = kept | {BARE: "yes" if alone else "", _THICKNESS: "0" if alone else repr(float(value))}
    write_labels(folder, rows)
    own = known.thickness[~bare]
    width = format_quantity(float(f"{2.0 * np.median(known.error[~bare]):.2g}"), "length")
    how = "tilted" if known.is_tilted else "level"
    return printed(
        f"Thickness under {len(own)} curves: {span(own.min(), own.max(), 'length')}, each ± {width} by the contact "
        f"points (95 %). The {bare.sum()} curves on the bare substrate, taken as {how}, are left out of the map."
    )


def _contact(
    folder: AnalysisFolder, file: SceneFile, name: str, row: Mapping[str, str], *, on_sample: bool
) -> tuple[float, float, tuple[float, ...]]:
    """Return the height of a contact, its standard uncertainty, and its position (x, y), all in m.

    The height is the depth reading from the zero that all curves share. The position comes from the labels, else
    from the file; it is empty where neither has one.
    """
    curve = read_whole(file, folder.curve_file(name))
    found = find_contact(curve, scene=file.draft if on_sample else None)
    labels = {
        place[1]: parse_quantity(f"{cell} {place[2]}", "length")
        for header, cell in row.items()
        if cell and (place := _PLACE.fullmatch(header))
    }
    own = curve.metadata.get("position")
    position = tuple(own[:2]) if isinstance(own, tuple) else ()
    # What a reader took off the axis so that it begins at zero.
    taken = float(curve.metadata.get("contact_height", 0.0))
    return (
        taken + found.depth,
        found.uncertainty,
        (labels["x"], labels["y"]) if len(labels) == 2 else position,
    )
