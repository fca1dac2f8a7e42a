"""Which second tip, pressed as deep and fitted jointly, would determine a parameter that one test does not."""

from __future__ import annotations

import contextlib
import math
import warnings
from dataclasses import dataclass

import numpy as np

from underlay._arrays import FloatArray, finite, read_only
from underlay._given import require_given, require_share
from underlay._threads import one_thread
from underlay.errors import InputError, ParameterError, UnderlayWarning
from underlay.inference.design.identifiability import SPECIMEN, about_specimen, deviation_of
from underlay.inference.design.planning import Grid, planned_problem
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.problem import Problem
from underlay.inference.profiling.walk import constrained_fit
from underlay.quantities import kind_of, path_of
from underlay.units import format_quantity

# Steps of the radii tried in a decade: tips are sold in similar steps.
_STEPS = (1.0, 2.0, 5.0)
# Largest factor between the radii tried and the present one.
_SPAN = 10.0
# Number of values assumed over an interval, and the factor by which it is extended where an end is infinite.
_PLACES, _OPEN = 5, 8.0
_LEVEL = 0.95  # confidence of that interval
# Ratio of errors up to which they are reported as one number.
_ALIKE = 1.3


@dataclass(frozen=True)
class SecondTest:
    """The expected effect of a second tip, pressed as deep as the first and fitted jointly with it.

    The forecast depends on the true value of the undetermined parameter, which is not known: it is made for m
    values over the interval of the first fit.

    Parameters
    ----------
    parameter : str
        The parameter that the fit does not determine.
    values : ndarray (m,)
        Assumed true values (SI), increasing.
    target : float
        Relative standard error that counts as determined.
    shape : str
        Shape of the tip, in words.
    radii : ndarray (r,)
        Tip radii tried (m), the one nearest to the present tip's first.
    stderr, peak_force : ndarray (m, r)
        Standard error of both tests together (SI; infinite where they do not determine the parameter, NaN where the
        test cannot be done), and the force at the deepest point (N).
    depth : float
        Depth of the second test (m).
    """

    parameter: str
    values: FloatArray
    target: float
    shape: str
    radii: FloatArray
    stderr: FloatArray
    peak_force: FloatArray
    depth: float

    @property
    def shares(self) -> FloatArray:
        """Relative standard error of both tests together, (m, r); infinite for an assumed value of zero."""
        size = np.broadcast_to(np.abs(self.values)[:, None], self.stderr.shape)
        return np.asarray(np.divide(self.stderr, size, out=np.full(size.shape, np.inf), where=size > 0.0))

    @property
    def radius(self) -> float | None:
        """Radius (m) of the tip that reaches the target for most of the assumed values; None if none does."""
        fixed = (self.shares <= self.target).sum(axis=0)
        return float(self.radii[int(np.argmax(fixed))]) if fixed.any() else None

    @property
    def sentence(self) -> str:
        """The advice in words, with the range of expected errors."""
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
        force = format_quantity(float(np.nanmax(self.peak_force[:, at])), "force")
        return (
            f"a second test with a {format_quantity(self.radius, 'length')} {shape}, pressed as deep (force "
            f"up to {force}) and fitted jointly, would fix it to {self._promise(self.shares[:, at])}"
        )

    def _promise(self, shares: FloatArray) -> str:
        """Text on one tip from its relative errors (m,): how well it determines the parameter, for which values."""
        fixed = shares <= self.target
        best, worst = float(shares[fixed].min()), float(shares[fixed].max())
        error = f"{100.0 * worst:.2g} %"
        if worst > _ALIKE * best:
            error = f"{100.0 * best:.2g} to {error}"
        if fixed.all():
            return error
        kind = kind_of(path_of(self.parameter))
        where = np.flatnonzero(fixed)
        words = []
        if where[0] > 0:
            words.append(f"{format_quantity(float(self.values[where[0]]), kind)} or more")
        if where[-1] < len(fixed) - 1:
            words.append(f"{format_quantity(float(self.values[where[-1]]), kind)} or less")
        lost = [
            format_quantity(float(self.values[i]), kind)
            for i in (where[0] - 1, where[-1] + 1)
            if 0 <= i < len(fixed)
        ]
        return f"{error} if it is {' and '.join(words)}, but not if it is {' or '.join(lost)}"


@one_thread()
def second_test(fit: Fit, parameter: str, *, value: float | None = None, target: float = 0.1) -> SecondTest:
    """Find a second tip that would determine a parameter that this fit does not.

    The parameter is assumed to have values over its 95 % interval, and the others those fitted with each; the
    second test is as deep and as noisy as the first, with the same free parameters of the instrument; the
    information of both adds (`Plan`).

    Parameters
    ----------
    fit : Fit
        A fit of one curve.
    parameter : str
        A fitted parameter of layer or substrate.
    value : float, optional
        Its true value (SI), where that is known from elsewhere; the forecast is then for this value only.
    target : float, default 0.1
        Relative standard error that counts as determined.

    Returns
    -------
    SecondTest
        With tips from a tenth to ten times the present radius, nearest first.

    Raises
    ------
    ParameterError
        If the parameter was not fitted, or the indenter has no radius.
    InputError
        If the fit is of several curves, no second test can be done, or the target is not between 0 and 1.

    Examples
    --------
    >>> import numpy as np
    >>> import underlay as ul
    >>> scene = ul.Scene(ul.Sphere(2e-4), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-3), ul.RIGID)
    >>> curve = ul.synthesize(scene, np.linspace(-1e-5, 2e-5, 100), ul.Noise(force=1e-5), 1)
    >>> fit = ul.fit(ul.Problem(scene, curve, ["layer.E", "layer.thickness", "instrument.contact_depth"]))
    >>> found = ul.second_test(fit, "layer.thickness", value=1e-3)
    >>> f"{1e3 * found.radius:.3g} mm"
    '0.5 mm'
    """
    require_given(fit, "fit", Fit)
    require_share(target, "target", what="the relative standard error that counts as fixed", one=True)
    if value is not None:
        value = finite(value, "value", "SI")
    if len(fit.curves) != 1:
        raise InputError(
            f"a second test is found for a fit of one curve; this one is of {len(fit.curves)}: plan asks for any"
        )
    specimen = [name for name in fit.names if name.startswith(SPECIMEN)]
    if parameter not in specimen:
        raise ParameterError(
            f"{parameter!r} must be a fitted parameter of layer or substrate; those are "
            f"{', '.join(specimen) or 'none'}"
        )
    own = fit.scenes[0].parameters.get("indenter.radius")
    if own is None:
        raise ParameterError(
            f"the second test has another radius, which {fit.scenes[0].indenter!r} does not have"
        )
    radii = _radii_near(own)
    supposed = _over_the_interval(fit, parameter) if value is None else [_with_others(fit, parameter, value)]
    forecasts, values, problem = [], [], None
    for vector in supposed:
        try:
            forecasts.append(_forecast(fit, vector, parameter, specimen, radii))
        except InputError as error:
            problem = error
            continue
        values.append(fit.problem.values(vector)[parameter])
    if not forecasts:
        raise InputError(f"no second test can be forecast: {problem}") from problem
    errors, forces = (np.array(column) for column in zip(*forecasts, strict=True))
    return SecondTest(
        parameter=parameter,
        values=read_only(np.array(values)),
        target=target,
        shape=type(fit.scenes[0].indenter).shape,
        radii=read_only(radii),
        stderr=read_only(errors),
        peak_force=read_only(forces),
        depth=_depth(fit, fit.vector),
    )


def remedy(fit: Fit, parameter: str, *, value: float | None = None, target: float = 0.1) -> SecondTest:
    """Return `second_test` of the same arguments, under its former name, with a warning."""
    warnings.warn("ul.remedy is called ul.second_test now: write that", UnderlayWarning, stacklevel=2)
    return second_test(fit, parameter, value=value, target=target)


def _depth(fit: Fit, vector: FloatArray) -> float:
    """Largest depth of the first test (m) from the contact point of a scaled vector (k,)."""
    return float(fit.curves[0].depth.max()) - fit.problem.scenes(vector)[0].instrument.contact_depth


def _forecast(
    fit: Fit, vector: FloatArray, parameter: str, specimen: list[str], radii: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Standard error of both tests (SI) and force of the second (N), (r,) each, if a vector (k,) is true."""
    problem, curve = fit.problem, fit.curves[0]
    timed = fit.scenes[0].memory is not None and curve.time is not None
    free = {path: given for path, given in problem.free.items() if not path.startswith("noise.")}
    record = (curve.depth - fit.scenes[0].instrument.contact_depth, curve.time) if timed else None

    def problem_of(radius: float, depth: float) -> Problem:
        scene = problem.scenes(vector)[0]
        return planned_problem(
            scene, radius, depth, free, fit.noises[0], len(curve.depth), problem.solver, record
        )

    second = Grid.of(problem_of, radii, np.array([_depth(fit, vector)]), specimen)
    # Both problems have the same free parameters and priors, hence the same coordinates but for their origin.
    first = sum(about_specimen(problem, vector, fit.noises, specimen))
    slope = float(problem.slopes(vector)[problem.names.index(parameter)])
    deviations = [deviation_of(first + own, specimen.index(parameter)) for own in second.information[:, 0]]
    possible = ~np.isnan(second.peak_force[:, 0])
    return np.where(possible, abs(slope) * np.array(deviations), np.nan), second.peak_force[:, 0]


def _over_the_interval(fit: Fit, parameter: str) -> list[FloatArray]:
    """Scaled vectors (k,) with the parameter at five values over its interval, the others fitted to each."""
    coordinate = fit.problem.coordinates[fit.names.index(parameter)]
    known = fit.interval(parameter, _LEVEL)
    low, high = max(known.low, coordinate.low), min(known.high, coordinate.high)
    here = fit.values[parameter]
    if math.isinf(known.low) or not low > 0.0:
        low = max(coordinate.low, (here if math.isinf(known.high) else high) / _OPEN)
    if math.isinf(known.high):
        high = min(coordinate.high, (here if math.isinf(known.low) else low) * _OPEN)
    ends = (coordinate.scaled(low), coordinate.scaled(high))
    places = coordinate.physical(np.linspace(*ends, _PLACES))
    vectors = []
    for place in places:
        with contextlib.suppress(InputError):  # no law has this value
            vectors.append(_with_others(fit, parameter, float(np.clip(place, low, high))))
    return vectors


def _with_others(fit: Fit, parameter: str, value: float) -> FloatArray:
    """Scaled vector (k,) of the best fit in which the parameter has the given value (SI)."""
    return constrained_fit(fit, parameter, value)[1]


def _radii_near(own: float) -> FloatArray:
    """Radii (m) in steps of 1, 2, 5 between a tenth and ten times `own`, nearest in ratio first."""
    decades = 10.0 ** np.arange(np.floor(np.log10(own / _SPAN)), np.ceil(np.log10(own * _SPAN)) + 1.0)
    steps = np.multiply.outer(decades, _STEPS).ravel()
    far = np.abs(np.log(steps / own))
    kept = steps[(far <= np.log(_SPAN) + 1e-9) & (far > np.log(1.2))]
    return np.asarray(kept[np.argsort(np.abs(np.log(kept / own)), kind="stable")])
