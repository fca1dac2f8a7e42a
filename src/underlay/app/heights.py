"""Layer thickness at each site of a map, from contact heights on the sample and on the bare substrate beside it.

All curves must count depth from one common zero, as for a piezo or stage that is not moved in between. Then the
depth reading of a contact is a height in space, and two of them differ by the thickness.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from underlay._arrays import FloatArray
from underlay.app.folder import AnalysisFolder
from underlay.app.labels import BARE, read_labels, write_labels
from underlay.data.contact_point import find_contact
from underlay.errors import InputError
from underlay.inference.from_files import read_whole
from underlay.report.tables import span
from underlay.scene.scene_file import SceneFile
from underlay.units import format_quantity, parse_quantity, printed

__all__ = ["thickness_from_heights"]

_THICKNESS = "thickness (m)"
_PLACE = re.compile(r"([xy])\s*[(\[]\s*(\w+)\s*[)\]]")
# Least ratio of the directions of a plane for which it is one and no line: the sine of one degree.
_LEAST_SINE = 0.017


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
    terms = _terms([contact[2] for contact in found], bare)
    plane, _, _, _ = np.linalg.lstsq(terms[bare], height[bare], rcond=None)
    thickness = terms @ plane - height
    if (thickness[~bare] <= 0.0).any():
        raise InputError(
            f"{names[int(np.argmin(np.where(bare, np.inf, thickness)))]} meets the sample deeper than the bare "
            "substrate: do all curves count depth from one zero?"
        )
    freedom = bare.sum() - terms.shape[1]
    scatter = float(np.sqrt(np.sum(thickness[bare] ** 2) / freedom)) if freedom > 0 else 0.0
    # Of the plane at each place: its corners are known as well as their contact points, or as they scatter.
    reach = np.einsum("ij,jk,ik->i", terms, np.linalg.inv(terms[bare].T @ terms[bare]), terms)
    of_plane = max(scatter, float(np.sqrt(np.mean(error[bare] ** 2)))) * np.sqrt(reach)
    for name, alone, value in zip(names, bare, thickness, strict=True):
        kept = {key: cell for key, cell in rows[name].items() if "thickness" not in key}
        rows[name] = kept | {BARE: "yes" if alone else "", _THICKNESS: "0" if alone else repr(float(value))}
    write_labels(folder, rows)
    own = thickness[~bare]
    width = format_quantity(float(f"{2.0 * np.median(np.hypot(error, of_plane)[~bare]):.2g}"), "length")
    how = "level" if terms.shape[1] == 1 else "tilted"
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


def _terms(places: list[tuple[float, ...]], bare: np.ndarray) -> FloatArray:
    """Return the design matrix (curves, 1 or 3) of the substrate's height: a constant and, for a plane, x and y.

    `bare` marks the curves on the substrate; a plane needs at least three of them that are not on a line.
    """
    level = np.ones((len(places), 1))
    # A plane has three corners.
    if bare.sum() < 3 or not all(places):
        return level
    across = np.array(places, dtype=float)
    across -= across[bare].mean(axis=0)
    directions = np.linalg.svd(across[bare], compute_uv=False)
    return np.hstack((level, across)) if directions[1] > _LEAST_SINE * directions[0] else level
