"""How well the inputs of a test are known: the stated uncertainties, and assumed ones where none is stated.

All sizes are at 95 %. Those that are assumed are what laboratories and makers commonly quote (a cantilever's spring
constant by the thermal method 10 to 20 %: Hutter & Bechhoefer 1993, doi:10.1063/1.1143970, te Riet et al. 2011,
doi:10.1016/j.ultramic.2011.09.012; the rest: conventions, marked as assumed wherever they are printed).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from underlay.data.curve import Curve
from underlay.inference.uncertainty.answer import NORMAL_95
from underlay.mechanics.profile import Profile
from underlay.quantities import kind_of
from underlay.scene.scene import Scene
from underlay.units import format_quantity

#: Inputs that have no path in a scene: scales of all forces, depths, and heights of a measured tip.
FORCE, DEPTH, SPRING_CONSTANT, SENSITIVITY = "force", "depth", "spring_constant", "sensitivity"
HEIGHTS = "indenter.heights"
_GIVEN, _ASSUMED = "given", "assumed"
# Assumed, relative, 95 %: force, spring constant, depth.
_FORCE, _SPRING, _DEPTH = 0.02, 0.2, 0.01
# Assumed, relative, 95 %: the radius of a tip of 0.1 mm or more (ground and measured spheres) and of a smaller one
# (sizes of beads and etched tips), and the heights of a measured tip.
_LARGE_TIP, _RADIUS_LARGE, _RADIUS_SMALL, _HEIGHTS = 1e-4, 0.02, 0.04, 0.02
# Assumed, relative, 95 %: thickness, moduli of the substrate, axial shear modulus.
_THICKNESS, _SUBSTRATE_MODULUS, _AXIAL_SHEAR = 0.05, 0.10, 0.20
# Assumed, absolute, 95 %: Poisson's ratios, an angle of one degree. (A ratio of permeabilities: by a factor of 2,
# which moves an in-plane modulus by 18 % and the permeability by 46 %.)
_NU, _NU_AXIAL, _HALF_ANGLE = 0.04, 0.05, math.radians(1.0)
# A Poisson's ratio of one half, and how far below it may be (assumed, 95 %).
_INCOMPRESSIBLE, _NEARLY = 0.5, 0.02


@dataclass(frozen=True)
class Input:
    """A number of a test that was taken as known, and its uncertainty.

    Parameters
    ----------
    source : str
        Path of the scene, or `FORCE`, `DEPTH`, `SPRING_CONSTANT`, `SENSITIVITY`, `HEIGHTS`.
    down, up : float
        How far it may be below and above the entered value, 95 %: SI for a path, a relative share otherwise.
    size : str
        That uncertainty as people write it.
    origin : str
        ``"given"`` or ``"assumed"``.
    """

    source: str
    down: float
    up: float
    size: str
    origin: str


def inputs_of(scene: Scene, curve: Curve, free: Collection[str]) -> tuple[Input, ...]:
    """The uncertain inputs of one test; numbers that are fitted are not among them.

    Parameters
    ----------
    scene : Scene
        The test; its `uncertainties` are the stated ones.
    curve : Curve
        The curve; its metadata may state how well a cantilever is calibrated.
    free : collection of str
        Paths that are fitted.
    """
    stated = scene.uncertainties
    if stated == "none":
        return ()
    given: Mapping[str, float] = stated if isinstance(stated, Mapping) else {}
    found = [*_instrument(curve, given, free), *_numbers(scene, given, free)]
    if isinstance(scene.indenter, Profile):
        # All heights have one common relative error, which the scene has no path for.
        found.append(_share(HEIGHTS, given, _HEIGHTS, _ASSUMED))
    return tuple(entry for entry in found if entry.down > 0.0 or entry.up > 0.0)


def _instrument(curve: Curve, given: Mapping[str, float], free: Collection[str]) -> Iterator[Input]:
    """Uncertain scales of force and depth, which act on every reading: calibration of sensor or cantilever."""
    has_lever = "spring_constant" in curve.metadata or SPRING_CONSTANT in given
    fits_lever = any(path.startswith("lever.") for path in free)
    if not fits_lever and has_lever and FORCE not in given:
        own = _stated_share(curve, "spring_constant_uncertainty")
        yield _share(SPRING_CONSTANT, given, own or _SPRING, _GIVEN if own else _ASSUMED)
    elif not fits_lever:
        yield _share(FORCE, given, _FORCE, _ASSUMED)
    yield _share(DEPTH, given, _DEPTH, _ASSUMED)
    own = _stated_share(curve, "sensitivity_uncertainty")
    if own and not fits_lever:
        yield Input(SENSITIVITY, own, own, _percent(own), _GIVEN)


def _stated_share(curve: Curve, key: str) -> float:
    """A relative standard uncertainty in a file's metadata, converted to 95 %; zero where there is none."""
    own = curve.metadata.get(key)
    return NORMAL_95 * own if isinstance(own, float) and own > 0.0 else 0.0


def _share(source: str, given: Mapping[str, float], assumed: float, origin: str) -> Input:
    size = given.get(source, assumed)
    return Input(source, size, size, _percent(size), _GIVEN if source in given else origin)


def _numbers(scene: Scene, given: Mapping[str, float], free: Collection[str]) -> Iterator[Input]:
    for path, value in scene.parameters.items():
        if path in free or not math.isfinite(value):
            continue
        if path in given:
            size, origin = f"± {format_quantity(given[path], kind_of(path))}", _GIVEN
            found: tuple[float, float, str] | None = (given[path], given[path], size)
        else:
            found, origin = _assumed(path, value), _ASSUMED
        if found is not None:
            down, up, size = found
            if path.endswith(".nu"):
                # No Poisson's ratio is above one half.
                up = min(up, max(_INCOMPRESSIBLE - value, 0.0))
            yield Input(path, down, up, size, origin)


def _assumed(path: str, value: float) -> tuple[float, float, str] | None:
    """Assumed 95 % uncertainty of a number: how far below and above, and as text; None where none is assumed."""
    section, _, name = path.rpartition(".")
    of_tip, of_base = section == "indenter", section.startswith("substrate")
    if name == "nu" and value == _INCOMPRESSIBLE:
        return _NEARLY, 0.0, f"{value - _NEARLY:g} to {value:g}"
    if name == "nu":
        return _NU, _NU, f"± {_NU:g}"
    if name == "nu_axial":
        return _NU_AXIAL, _NU_AXIAL, f"± {_NU_AXIAL:g}"
    if name == "permeability_ratio":
        return 0.5 * value, value, "a factor of 2"
    if of_tip and name == "half_angle":
        return _HALF_ANGLE, _HALF_ANGLE, "± 1 deg"
    shares = {
        "radius": (of_tip, _RADIUS_LARGE if value >= _LARGE_TIP else _RADIUS_SMALL),
        "thickness": (True, _THICKNESS),
        "G_axial": (True, _AXIAL_SHEAR),
        "E": (of_base, _SUBSTRATE_MODULUS),
        "E_axial": (of_base, _SUBSTRATE_MODULUS),
    }
    acts, share = shares.get(name, (False, 0.0))
    return (share * value, share * value, _percent(share)) if acts else None


def _percent(share: float) -> str:
    return f"± {100.0 * share:.2g} %"
