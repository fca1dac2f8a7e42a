"""The modulus of a film from its contact stiffness S(h), where the loading itself is plastic.

In an indentation that leaves an imprint only the unloading is elastic. At every depth h the stiffness of a
continuous-stiffness test is that of a flat punch of the contact's size on the layered body (Argatov and Sabina,
equations 9.1 and 9.6), in series with that of the tip itself:

    beta 2 a / S = 1/M(a) + 1/M_tip,    M(a) = S_punch(a) / (2 a)

with M(a) the effective modulus of the body for a punch of radius a, M_tip = E / (1 - nu^2) of the tip, beta the
factor for a punch that is not round, and a from the contact depth h_c = h - 0.75 P/S (P the force; Oliver and Pharr
1992) by the tip's area function. `fit_stiffness` takes a curve; `fit_film` files, of the test and of one on a
sample of known modulus with the same tip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import interpolate, optimize

from underlay._arrays import FloatArray
from underlay._given import require_given
from underlay.data.curve import Curve
from underlay.data.readers import read
from underlay.errors import CurveError, InputError
from underlay.inference.from_files import read_whole
from underlay.mechanics.indenters import Cone, FlatPunch
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, Exact, as_solver
from underlay.mechanics.stiffness_relation import AreaFunction
from underlay.scene.parameters import unknown_parameter
from underlay.scene.scene import Scene
from underlay.scene.scene_file import SceneFile
from underlay.units import parse_quantity

#: E / (1 - nu^2) (Pa) of a diamond tip, E = 1070 GPa and nu = 0.07.
DIAMOND = 1070e9 / (1.0 - 0.07**2)
# Number of radii at which a body's M(a) is computed; between them a cubic in ln a is accurate to 1e-4.
_NODES = 9
# Relative tolerance of the flat punch's law.
_RTOL = 1e-4
# Step in ln(parameter) for derivatives of ln M: far above the law's error, far below its curvature.
_STEP = 0.02
# Least number of depths for a fit.
_FEWEST = 4
# Stiffness above that of any instrument (N/m): larger values in a file mean "no value".
_LARGEST = 1e12
# Half width of a normal 95 % interval in standard errors.
_WIDTH = 1.959964
# epsilon of a paraboloid's unloading curve (Oliver and Pharr 1992).
_EPSILON = 0.75


@dataclass(frozen=True, eq=False)
class StiffnessFit:
    """Moduli fitted to a measured contact stiffness.

    Parameters
    ----------
    values, low, high : mapping of str to float
        Fitted parameters (SI) and the ends of their 95 % intervals from the measured scatter between tests, which
        is taken to shift all depths of one test together.
    scatter : float
        Standard deviation of ln(S measured / S modelled): the part of the trend with depth that the model does not
        explain.
    area_sensitivity : mapping of str to float
        d ln(value) / d ln(area): per cent by which the value changes for 1 % more in the area function. Where a
        file states nothing of its tip, this is the largest uncertainty.
    table : pandas.DataFrame
        One row per depth (SI): ``depth``, ``contact radius``, ``a/h``, ``stiffness``, ``fitted stiffness``,
        ``noise`` (of the stiffness), ``half-space modulus`` (by Oliver and Pharr, corrected for the tip) and
        ``layer modulus`` (corrected for the base as well) with ``layer modulus noise``, that due to the stiffness.
    scene : Scene
        The scene with the fitted values.
    """

    values: Mapping[str, float]
    low: Mapping[str, float]
    high: Mapping[str, float]
    scatter: float
    area_sensitivity: Mapping[str, float]
    table: pd.DataFrame
    scene: Scene


def fit_stiffness(
    curve: Curve,
    scene: Scene,
    *,
    free: Sequence[str] = ("layer.E",),
    area: AreaFunction | None = None,
    tip_modulus: float = DIAMOND,
    punch_factor: float = 1.05,
    depths: tuple[float, float] = (0.0, np.inf),
    solver: AnySolver | None = None,
) -> StiffnessFit:
    """Fit moduli of a film and its base to a continuous-stiffness test.

    Parameters
    ----------
    curve : Curve
        The test, with the column ``contact_stiffness`` (N/m), and ``contact_stiffness_scatter``, ``depth_scatter``,
        ``force_scatter`` as far as they were measured: they are the noise.
    scene : Scene
        Film and base; its indenter is the cone that the pyramid is equivalent to.
    free : sequence of str, default ("layer.E",)
        Positive numbers of the scene to fit, such as ``"substrate.E"``.
    area : AreaFunction, optional
        Area function of the tip; by default that of the scene's perfect cone.
    tip_modulus : float, default that of diamond
        E / (1 - nu^2) of the tip (Pa).
    punch_factor : float, default 1.05
        beta: how much stiffer a triangular punch is than a round one of its area (King 1987).
    depths : (float, float)
        Depths (m) between which points are used.
    solver : Solver or str, optional
        What builds the flat punch's law; `Exact(1e-4)` by default.

    Raises
    ------
    CurveError
        If the curve has no stiffness, or too few points of it.
    InputError
        If the indenter is no cone, or a parameter is none of the scene.
    """
    require_given(curve, "curve", Curve)
    require_given(scene, "scene", Scene)
    if not isinstance(scene.indenter, Cone):
        raise InputError(
            "continuous stiffness is read with a pyramid: the indenter is to be its equivalent cone, "
            f"70.32 degrees of a Berkovich tip; got {scene.indenter.shape!r}"
        )
    for path in free:
        if path not in scene.parameters:
            raise unknown_parameter(path, scene.parameters)
    measured = _measured(curve, depths, area or AreaFunction.of_cone(scene.indenter))
    model = _Model(
        scene, tuple(free), measured.radius, tip_modulus, punch_factor, as_solver(solver or Exact(_RTOL))
    )
    logs = np.log([scene.parameters[path] for path in free])

    def misfit(at: FloatArray) -> FloatArray:
        return (model.log_stiffness(at) - measured.log_stiffness) / measured.noise

    found = optimize.least_squares(misfit, logs, x_scale=0.3)
    return _result(curve, model, measured, found.x)


@dataclass(frozen=True, eq=False)
class _Measured:
    """Data of a continuous-stiffness test, (n,) each.

    Depth (m), contact radius (m), ln S (S in N/m), the noise of ln S relative to the model (1 where unknown), and
    the same as `scatter` (NaN where unknown).
    """

    depth: FloatArray
    radius: FloatArray
    log_stiffness: FloatArray
    noise: FloatArray
    scatter: FloatArray


def _measured(curve: Curve, depths: tuple[float, float], area: AreaFunction) -> _Measured:
    part = curve.loading()
    if "contact_stiffness" not in part.columns:
        raise CurveError(
            f"{curve.metadata.get('name', 'the curve')} has no contact stiffness: only a test with continuous "
            "stiffness can be fitted so; of another, give the stiffness at the start of unloading to "
            "modulus_from_stiffness"
        )
    h, P, S = part.depth, part.force, part.columns["contact_stiffness"]
    usable = np.isfinite(S) & (S > 0.0) & (S < _LARGEST) & (P > 0.0) & (h >= depths[0]) & (h <= depths[1])
    usable[usable] &= h[usable] - _EPSILON * P[usable] / S[usable] > 0.0
    if np.count_nonzero(usable) < _FEWEST:
        raise CurveError(
            f"only {np.count_nonzero(usable)} points with a contact stiffness lie between these depths"
        )
    h, P, S = h[usable], P[usable], S[usable]
    spread = [
        _known(part.columns[name][usable]) if name in part.columns else np.zeros(len(h))
        for name in ("depth_scatter", "force_scatter", "contact_stiffness_scatter")
    ]
    contact = h - _EPSILON * P / S
    # Error of ln S - ln(2 a beta M'): the radius a depends on all three readings, S itself on one.
    rate = _log_rate(area, contact) / contact
    parts = (
        rate * spread[0],
        rate * _EPSILON / S * spread[1],
        (1.0 / S - rate * _EPSILON * P / S**2) * spread[2],
    )
    noise = np.sqrt(sum((part**2 for part in parts), np.zeros(len(h))))
    return _Measured(
        h,
        area.radius(contact),
        np.log(S),
        np.where(noise > 0.0, noise, 1.0),
        np.where(noise > 0.0, noise, np.nan),
    )


def _known(scatter: FloatArray) -> FloatArray:
    """Scatter where it was measured, zero where it is not finite."""
    return np.where(np.isfinite(scatter), scatter, 0.0)


def _log_rate(area: AreaFunction, contact: FloatArray) -> FloatArray:
    """d ln a / d ln h_c of the tip, (n,): contact radius a with contact depth h_c."""
    return np.asarray(np.log(area.radius(1.01 * contact) / area.radius(contact)) / np.log(1.01))


@dataclass(frozen=True, eq=False)
class _Model:
    """Model of ln S, S the stiffness of a punch of given radii (m), (n,), as a function of the numbers `free`."""

    scene: Scene
    free: tuple[str, ...]
    radius: FloatArray
    tip_modulus: float
    punch_factor: float
    solver: Solver

    def scene_at(self, logs: FloatArray) -> Scene:
        """Scene at logarithms of the free numbers."""
        return self.scene.with_values(dict(zip(self.free, np.exp(logs).tolist(), strict=True)))

    def modulus(self, logs: FloatArray) -> FloatArray:
        """M(a) = S_punch / (2 a) of the body (Pa), (n,)."""
        scene = self.scene_at(logs)
        low, high = float(self.radius.min()), float(self.radius.max())
        nodes = np.geomspace(0.999 * low, 1.001 * high, _NODES)
        punches = []
        for node in nodes.tolist():
            punch = Scene(FlatPunch(node), scene.layer, scene.substrate)
            depth = 1e-3 * node
            punches.append(
                float(punch.contact_law(depth, solver=self.solver).stiffness(depth)) / (2.0 * node)
            )
        curve = interpolate.CubicSpline(np.log(nodes), np.log(punches))
        return np.asarray(np.exp(curve(np.log(self.radius))))

    def log_stiffness(self, logs: FloatArray) -> FloatArray:
        """ln S (S in N/m) of the body and the tip in series, (n,)."""
        in_series = 1.0 / (1.0 / self.modulus(logs) + 1.0 / self.tip_modulus)
        return np.asarray(np.log(2.0 * self.punch_factor * self.radius * in_series))

    def sample_modulus(self, log_stiffness: FloatArray) -> FloatArray:
        """Effective modulus M (Pa) of the sample from ln of the stiffness, (n,), corrected for the tip."""
        return np.asarray(
            1.0 / (2.0 * self.punch_factor * self.radius / np.exp(log_stiffness) - 1.0 / self.tip_modulus)
        )


def _result(curve: Curve, model: _Model, measured: _Measured, logs: FloatArray) -> StiffnessFit:
    """The result of a fit, from the fitted logarithms of the free numbers."""
    fitted = model.log_stiffness(logs)
    slopes = np.stack(
        [
            (model.log_stiffness(logs + _STEP * one) - model.log_stiffness(logs - _STEP * one))
            / (2.0 * _STEP)
            for one in np.eye(len(logs))
        ],
        axis=1,
    )
    answer = np.linalg.pinv(slopes / measured.noise[:, None]) / measured.noise
    # All depths shifted together by the scatter of a test; and all areas by 1 %, which changes ln a by half of
    # that.
    deviation = np.abs(answer @ _known(measured.scatter))
    grown = (_along_radius(model, logs) * 0.5)[None] @ answer.T
    values = np.exp(logs)
    known = np.isfinite(measured.scatter).any()
    half = _WIDTH * deviation if known else np.full(len(logs), np.inf)

    def named(numbers: FloatArray) -> dict[str, float]:
        return dict(zip(model.free, numbers.tolist(), strict=True))

    return StiffnessFit(
        values=named(values),
        low=named(values * np.exp(-half)),
        high=named(values * np.exp(half)),
        scatter=float(np.std(measured.log_stiffness - fitted)),
        area_sensitivity=named(-grown[0]),
        table=_table(curve, model, measured, logs, fitted, slopes),
        scene=model.scene_at(logs),
    )


def _along_radius(model: _Model, logs: FloatArray) -> FloatArray:
    """d ln S / d ln a of the model, (n,): stiffness S with contact radius a."""
    grown, shrunk = (
        replace(model, radius=factor * model.radius) for factor in (np.exp(_STEP), np.exp(-_STEP))
    )
    return np.asarray((grown.log_stiffness(logs) - shrunk.log_stiffness(logs)) / (2.0 * _STEP))


def _table(
    curve: Curve, model: _Model, measured: _Measured, logs: FloatArray, fitted: FloatArray, slopes: FloatArray
) -> pd.DataFrame:
    """Table of a stiffness fit, one row per depth; columns as in `StiffnessFit.table`."""
    scene, nu = model.scene_at(logs), model.scene.layer.material.nu
    stiffness = np.exp(measured.log_stiffness)
    frame = pd.DataFrame(
        {
            "depth": measured.depth,
            "contact radius": measured.radius,
            "a/h": measured.radius / scene.layer.thickness,
            "stiffness": stiffness,
            "fitted stiffness": np.exp(fitted),
            "noise": stiffness * measured.scatter,
            "half-space modulus": model.sample_modulus(measured.log_stiffness) * (1.0 - nu * nu),
        }
    )
    if "layer.E" in model.free:
        power = slopes[:, model.free.index("layer.E")]
        # To first order: the film's modulus that explains the remaining difference at this depth.
        frame["layer modulus"] = scene.layer.material.E * np.exp((measured.log_stiffness - fitted) / power)
        frame["layer modulus noise"] = frame["layer modulus"] * measured.scatter / power
    frame.attrs["curve"] = str(curve.metadata.get("name") or "")
    return frame


def fit_film(
    file: SceneFile, curve: Path, calibration: Path | None, known_modulus: str | None, ends: tuple[str, str]
) -> StiffnessFit:
    """Fit the free parameters of layer and substrate to the contact stiffness of a file.

    Parameters
    ----------
    file : SceneFile
        The test; its [fit] section names the free parameters.
    curve, calibration : Path
        Files of the film, and of a sample of known modulus with the same tip; None for a perfect tip.
    known_modulus : str
        E / (1 - nu^2) of that sample, with its unit.
    ends : (str, str)
        Smallest and largest depth that are used, with units.

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
