"""The modulus of a film from files: the test, and one on a sample of known modulus with the same tip."""

from __future__ import annotations

from pathlib import Path

from underlay.data.readers import read
from underlay.errors import InputError
from underlay.inference.films import DIAMOND, StiffnessFit, fit_stiffness
from underlay.inference.from_files import read_whole
from underlay.mechanics.area_function import AreaFunction
from underlay.scene.scene_file import SceneFile
from underlay.units import parse_quantity

__all__ = ["fit_film"]

_EPSILON = 0.75


def fit_film(
    file: SceneFile, curve: Path, calibration: Path | None, known_modulus: str | None, ends: tuple[str, str]
) -> StiffnessFit:
    """Fit what [fit] frees of layer and substrate to the contact stiffness of a file.

    Parameters
    ----------
    file : SceneFile
        The test.
    curve, calibration : Path
        Files of the film, and of a sample of known modulus with the same tip; None for a perfect tip.
    known_modulus : str
        E / (1 - nu^2) of that sample, with its unit.
    ends : (str, str)
        Shallowest and deepest depth that count, with units.

    Raises
    ------
    CurveError, InputError
        If nothing of layer or substrate is free, or a file has no contact stiffness.
    """
    depths = tuple(parse_quantity(end, "length") for end in ends)
    free = [entry.path for entry in file.free if entry.path.startswith(("layer.", "substrate."))]
    if not free:
        raise InputError(f"{file.path.name} frees nothing of layer or substrate in [fit]: say layer.E = {{}}")
    area = None if calibration is None else _area(calibration, known_modulus)
    whole = read_whole(file, curve)
    return fit_stiffness(whole, file.scene, free=free, area=area, depths=(depths[0], depths[1]))


def _area(path: Path, modulus: str | None) -> AreaFunction:
    """Area function of the tip from a test on a sample of known modulus."""
    if modulus is None:
        raise InputError('--calibration needs --known-modulus, such as "165 GPa" for (001) silicon')
    test = read(path).loading()
    if "contact_stiffness" not in test.columns:
        raise InputError(f"{path.name} has no contact stiffness: a calibration needs a test with S(h)")
    S = test.columns["contact_stiffness"]
    usable = (S > 0.0) & (test.force > 0.0) & (test.depth > 0.0)
    contact = test.depth[usable] - _EPSILON * test.force[usable] / S[usable]
    inside = contact > 0.0
    reduced = 1.0 / (1.0 / parse_quantity(modulus, "pressure") + 1.0 / DIAMOND)
    return AreaFunction.calibrated(contact[inside], S[usable][inside], modulus=reduced)
