"""Which second tip would fix what one test leaves open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import InputError, ParameterError
from underlay.inference.design.information import SPECIMEN, about_specimen, deviation_of
from underlay.inference.design.planning import plan
from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit

__all__ = ["Remedy", "remedy"]

# Tips are sold in steps like these.
_STEPS = (1.0, 2.0, 5.0)
# Radii tried: up to so many times larger and smaller than the one at hand.
_SPAN = 10.0


@dataclass(frozen=True)
class Remedy:
    """What a second tip, pressed as deep as the first and fitted jointly, would bring.

    Parameters
    ----------
    parameter : str
        What the fit leaves open.
    value : float
        What it is supposed to be (SI): the forecast rests on it.
    target : float
        Relative standard error that counts as fixed.
    shape : str
        Of the tip.
    radii, stderr, peak_force : ndarray (r,)
        Tips tried (m), the standard error of both tests together (SI; infinite where they do not fix it, NaN
        where the test cannot be done), and the force at the deepest point (N).
    depth : float
        Of the second test (m).
    """

    parameter: str
    value: float
    target: float
    shape: str
    radii: FloatArray
    stderr: FloatArray
    peak_force: FloatArray
    depth: float

    @property
    def radius(self) -> float | None:
        """Radius (m) of the tip nearest to the one at hand that fixes the parameter; None if none does."""
        fixes = self.stderr <= self.target * abs(self.value)
        return float(self.radii[int(np.argmax(fixes))]) if fixes.any() else None

    @property
    def sentence(self) -> str:
        """The advice in words."""
        shape = self.shape.replace("_", " ")
        if self.radius is None:
            low, high = (
                format_quantity(float(end), "length") for end in (self.radii.min(), self.radii.max())
            )
            return (
                f"no second {shape} between {low} and {high} would fix it, pressed as deep: measure it "
                "otherwise and give it a prior"
            )
        at = int(np.flatnonzero(self.radii == self.radius)[0])
        return (
            f"a second test with a {format_quantity(self.radius, 'length')} {shape}, pressed as deep (force "
            f"up to {format_quantity(float(self.peak_force[at]), 'force')}) and fitted jointly, would fix it to "
            f"{100.0 * self.stderr[at] / abs(self.value):.2g} %"
        )


def remedy(fit: Fit, parameter: str, *, value: float | None = None, target: float = 0.1) -> Remedy:
    """Find a second tip that would fix a parameter this fit leaves open.

    The specimen is taken as the fit found it, the second test as deep and as noisy as the first, its contact
    point, baseline and compliance as free as there; information of the two adds (`Plan`).

    Parameters
    ----------
    fit : Fit
        Of one curve.
    parameter : str
        A fitted parameter of layer or substrate.
    value : float, optional
        What the parameter is supposed to be (SI), where the fit's value means nothing: the layer of a test
        that did not feel its base may have any thickness.
    target : float, default 0.1
        Relative standard error that counts as fixed.

    Returns
    -------
    Remedy
        With tips from a tenth to ten times the radius at hand, nearest first.

    Raises
    ------
    ParameterError
        If the parameter was not fitted, or the indenter has no radius.
    InputError
        If the fit is of several curves, or no second test can be done.

    Examples
    --------
    >>> import numpy as np
    >>> import underlay as ul
    >>> scene = ul.Scene(ul.Sphere(2e-4), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.RIGID)
    >>> curve = ul.synthesize(scene, np.linspace(-1e-5, 2e-5, 100), ul.Noise(force=1e-5), 1)
    >>> fit = ul.fit(ul.Problem(scene, curve, ["layer.E", "layer.thickness", "instrument.contact_depth"]))
    >>> found = ul.remedy(fit, "layer.thickness", value=1e-3)
    >>> f"{1e3 * found.radius:.3g} mm"
    '0.5 mm'
    """
    if len(fit.curves) != 1:
        raise InputError(f"a remedy is for a fit of one curve; this one is of {len(fit.curves)}: see plan()")
    problem, scene = fit.problem, fit.scenes[0]
    specimen = [name for name in problem.names if name.startswith(SPECIMEN)]
    if parameter not in specimen:
        raise ParameterError(
            f"{parameter!r} must be a fitted parameter of layer or substrate; those are "
            f"{', '.join(specimen) or 'none'}"
        )
    own = scene.parameters.get("indenter.radius")
    if own is None:
        raise ParameterError(f"a remedy is another radius, which {scene.indenter!r} does not have")
    supposed = fit.values[parameter] if value is None else value
    scene = scene.with_values({parameter: supposed})
    radii = _radii_near(own)
    depth = float(fit.curves[0].depth.max()) - scene.instrument.contact_depth
    planned = plan(
        scene,
        free={path: given for path, given in problem.free.items() if not path.startswith("noise.")},
        noise=fit.noises[0],
        radii=np.sort(radii),
        depths=[depth],
        parameter=parameter,
        points=len(fit.curves[0].depth),
        solver=problem.solver,
    )
    # Both problems have the same free parameters and priors, hence the same coordinates but for their origin.
    there = problem.vector({**fit.values, parameter: supposed})
    first = sum(about_specimen(problem, there, fit.noises, specimen))
    slope = float(problem.slopes(there)[problem.names.index(parameter)])
    index = specimen.index(parameter)
    errors, forces = np.full(len(radii), np.nan), np.full(len(radii), np.nan)
    for at, radius in enumerate(radii):
        cell = int(np.argmin(np.abs(planned.radii - radius)))
        if (cell, 0) in planned.refusals:
            continue
        both = first + planned.scaled_information[cell, 0]
        errors[at] = abs(slope) * deviation_of(both, index)
        forces[at] = planned.peak_force[cell, 0]
    return Remedy(
        parameter=parameter,
        value=supposed,
        target=target,
        shape=type(scene.indenter).shape,
        radii=read_only(radii),
        stderr=read_only(errors),
        peak_force=read_only(forces),
        depth=depth,
    )


def _radii_near(own: float) -> FloatArray:
    """Radii (m) in the usual steps, nearest in ratio to `own` first; not its own neighbourhood."""
    decades = 10.0 ** np.arange(np.floor(np.log10(own / _SPAN)), np.ceil(np.log10(own * _SPAN)) + 1.0)
    steps = np.multiply.outer(decades, _STEPS).ravel()
    far = np.abs(np.log(steps / own))
    kept = steps[(far <= np.log(_SPAN) + 1e-9) & (far > np.log(1.2))]
    return np.asarray(kept[np.argsort(np.abs(np.log(kept / own)), kind="stable")])
