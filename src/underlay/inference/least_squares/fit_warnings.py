"""Warnings of a fit, in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain

import numpy as np

from underlay._arrays import FloatArray
from underlay.inference.file_facts import EVERYTHING, settle
from underlay.inference.least_squares.diagnostics import ResidualDiagnostics, over_whitened
from underlay.inference.least_squares.fit_result import Alternative, FitStatistics, FitWarning
from underlay.inference.model.members import Member
from underlay.inference.problem import Problem
from underlay.mechanics.contact_law import ContactLaw, DeeperThanLayer
from underlay.quantities import kind_of
from underlay.scene.noise import NoiseModel
from underlay.units import format_quantity

# Standard error in a scaled coordinate from which it says nothing: a factor e either way, or the whole range of the
# curve.
_UNINFORMATIVE = 1.0
# Standard error in a scaled coordinate above which its size is not quoted: a factor of a million.
_BEYOND_SENSE = 14.0
# Correlation of two parameters from which they may be known only together.
_STRONG_CORRELATION = 0.99
# Standard deviations of a prior beyond which it is not believed: 99.9 % of what it foresaw lies within.
_CONTRADICTED = 3.4
# A standard error, in scaled coordinates, above which a parameter is badly known.
_BADLY_KNOWN = 0.05
#: Code of the warning that a curve shows no contact.
NO_CONTACT = "no-contact"
# Squared standard deviations by which a contact must explain the force better than a straight line: three free
# parameters reach 30 by chance in one curve of a million.
_LEAST_GAIN = 30.0


def warnings_of(
    problem: Problem,
    laws: Sequence[ContactLaw],
    reasons: Mapping[str, str],
    bounds_hit: Mapping[str, str],
    covariance: FloatArray,
    correlated: Sequence[ResidualDiagnostics | None],
    statistics: FitStatistics,
    alternatives: Sequence[Alternative],
) -> tuple[FitWarning, ...]:
    """Warnings about convergence, parameters, other optima, residuals, the contact law and the file, in this order.

    Parameters
    ----------
    problem : Problem
        What was fitted.
    laws : sequence of ContactLaw
        Laws behind the curves, one each.
    reasons, bounds_hit : mapping of str to str
        `Fit.no_error_bars` and `Fit.bounds_hit`.
    covariance : FloatArray
        Covariance of the scaled parameters, (k, k).
    correlated : sequence of ResidualDiagnostics or None
        One per curve: the diagnostics where its residuals are correlated enough to matter, else None.
    statistics : FitStatistics
        Statistics of the fit.
    alternatives : sequence of Alternative
        Other optima.
    """
    return tuple(
        chain(
            _not_fixed(reasons, bounds_hit, statistics),
            _unfixed(problem, covariance),
            _correlated(problem, covariance),
            _second_optima(alternatives),
            _residuals(correlated, is_weighed=problem.noise_is_open),
            _law_range(laws),
            _law_error(problem, covariance, statistics),
            _file_facts(problem),
        )
    )


def which_curve(number: int, count: int) -> str:
    """Begin a sentence about the curve of an index, where there are several."""
    return f"curve {number + 1}: " if count > 1 else ""


def _not_fixed(
    reasons: Mapping[str, str], bounds_hit: Mapping[str, str], statistics: FitStatistics
) -> Iterator[FitWarning]:
    if not statistics.success:
        yield FitWarning("not-converged", f"the fit did not converge: {statistics.stopped}")
    for name, bound in bounds_hit.items():
        yield FitWarning("bound", f"{name} ended on its {bound}: the data would have it beyond")
    for name, reason in reasons.items():
        if name not in bounds_hit:
            yield FitWarning("not-fixed", f"{name} has no error bar: {reason}")


def _file_facts(problem: Problem) -> list[FitWarning]:
    """Warnings where a scene differs from what its curve's file states, unless the curve's notes already say so."""
    notes = [
        note
        for member in problem.members
        for note in settle(member.scene, member.curve, overrule=EVERYTHING, free=member.entries).notes
        if note not in member.curve.metadata.get("notes", ())
    ]
    return [FitWarning("file", note) for note in dict.fromkeys(notes)]


def _unfixed(problem: Problem, covariance: FloatArray) -> Iterator[FitWarning]:
    deviations = np.sqrt(covariance.diagonal()).tolist()
    for coordinate, deviation in zip(problem.coordinates, deviations, strict=True):
        if deviation <= _UNINFORMATIVE:
            continue
        size = f"a factor of {np.exp(deviation):.3g}" if deviation < _BEYOND_SENSE else "beyond any factor"
        if coordinate.scale is not None:
            size = f"{deviation:.3g} times its natural range"
        yield FitWarning(
            "not-fixed",
            f"{coordinate.name} is not determined by these data: its standard error is {size}; measure it "
            "otherwise and give it a prior, or add a test (identify, plan)",
        )


def _correlated(problem: Problem, covariance: FloatArray) -> Iterator[FitWarning]:
    """One warning for each group of parameters that strong correlations link and that are known only together."""
    if not (covariance.diagonal() > _BADLY_KNOWN**2).any():
        return
    deviation = np.sqrt(np.diag(covariance))
    product = np.outer(deviation, deviation)
    correlation = np.divide(covariance, product, out=np.zeros_like(product), where=product > 0.0)
    linked = np.abs(correlation) > _STRONG_CORRELATION
    if not np.triu(linked, 1).any():
        return
    # Parameters connected by any chain of strong correlations form a group, numbered by its first member.
    reached = np.linalg.matrix_power(linked | np.eye(len(linked), dtype=bool), len(linked))
    group = np.argmax(reached, axis=1)
    for number in np.unique(group):
        members = np.flatnonzero(group == number)
        if len(members) < 2 or not _only_together(covariance[np.ix_(members, members)]):
            continue
        block = np.triu(correlation[np.ix_(members, members)], 1)
        i, j = np.unravel_index(int(np.argmax(np.abs(block))), block.shape)
        *others, last = (problem.names[member] for member in members)
        pair = f" of {problem.names[members[i]]} and {problem.names[members[j]]}" if len(others) > 1 else ""
        yield FitWarning(
            "correlated",
            f"{', '.join(others)} and {last} are known only together (correlation{pair} {block[i, j]:+.4f}); "
            "see what identify says of them",
        )


def _only_together(covariance: FloatArray) -> bool:
    """Whether a parameter of a correlated group is badly known by itself, but well if the others were known.

    A strong correlation alone is harmless: both parameters may be known to a per mille. `covariance` is that of the
    group's scaled parameters, (g, g).
    """
    single, inverse = np.diag(covariance), np.diag(np.linalg.pinv(covariance))
    alone = np.divide(1.0, inverse, out=np.full_like(inverse, np.inf), where=inverse > 0.0)
    return bool(((single > _BADLY_KNOWN**2) & (alone < _BADLY_KNOWN**2)).any())


def _second_optima(alternatives: Sequence[Alternative]) -> Iterator[FitWarning]:
    for entry in alternatives:
        values = ", ".join(
            f"{name} {format_quantity(value, kind_of(name))}" for name, value in entry.values.items()
        )
        yield FitWarning(
            "second-optimum",
            "another optimum explains the data nearly as well (chi-square "
            f"{entry.delta_chi_square:.2g} higher): {values}; standard errors say nothing of it, "
            "a profile calibrated with drawn curves or a posterior does",
        )


def _residuals(correlated: Sequence[ResidualDiagnostics | None], *, is_weighed: bool) -> Iterator[FitWarning]:
    """One warning per curve with correlated residuals.

    `is_weighed` says that the intervals allow for the correlation.
    """
    # A correlation time alone is no better: with white noise on top, the rule, its intervals are too narrow.
    advice = (
        "the intervals allow for it"
        if is_weighed
        else "leave the stated noise out: what the curve shows is allowed for then; or the model is wrong"
    )
    for number, entry in enumerate(correlated):
        if entry is not None:
            yield FitWarning(
                "correlated-residuals",
                f"{which_curve(number, len(correlated))}the residuals are correlated (lag-one correlation "
                f"{entry.lag_one:.2f}, {entry.runs} runs where {entry.expected_runs:.0f} are expected): "
                f"{entry.points} points count as {entry.effective_points:.0f} independent ones, so the standard "
                f"errors are too small by a factor of about {entry.too_narrow_by:.1f}; {advice}",
            )


def without_contact(problem: Problem, residuals: Sequence[FloatArray]) -> Iterator[FitWarning]:
    """One warning per curve without contact (`no_contact`), from the residuals of its force (N), (n,)."""
    for number, (member, residual) in enumerate(zip(problem.members, residuals, strict=True)):
        reason = no_contact(member.forward.depth, member.force, float(residual @ residual), problem.names)
        if reason:
            yield FitWarning(NO_CONTACT, which_curve(number, len(residuals)) + reason)


def no_contact(depth: FloatArray, force: FloatArray, square: float, names: Iterable[str]) -> str:
    """Reason why a fitted curve shows no contact: a straight line explains its force as well; empty if it does.

    Parameters
    ----------
    depth, force : FloatArray
        Readings (m, N), (n,).
    square : float
        Sum of the squared residuals of the fit (N^2).
    names : iterable of str
        The free parameters; with a free slope of the baseline the line may slope.
    """
    free = list(names)
    sloping = any(name.startswith("instrument.baseline_slope") for name in free)
    flat = force - force.mean()
    if sloping:
        along = depth - depth.mean()
        flat = flat - along * float(along @ flat / (along @ along))
    variance = square / max(len(force) - len(free), 1)
    if float(flat @ flat) - square > _LEAST_GAIN * variance:
        return ""
    flat_one = "a straight line" if sloping else "a constant force"
    return f"no contact: {flat_one} explains the curve as well as any contact within the bounds does"


def too_deep(problem: Problem, physical: FloatArray) -> Iterator[FitWarning]:
    """One warning per curve whose tip goes deeper than the layer is thick, at parameter values (SI), (k,)."""
    for member in problem.members:
        values = member.values_at(physical)
        doubt = DeeperThanLayer.of(_deepest(member, values), values["layer.thickness"])
        if doubt is not None:
            yield FitWarning("too-deep", str(doubt))


def ignored_sides(problem: Problem, physical: FloatArray, laws: Sequence[ContactLaw]) -> Iterator[FitWarning]:
    """One warning per curve whose layer has a finite width that its law neglects although it matters.

    Parameters
    ----------
    problem : Problem
        What was fitted.
    physical : FloatArray
        Parameter values (SI), (k,).
    laws : sequence of ContactLaw
        Law of each curve.
    """
    for member, law in zip(problem.members, laws, strict=True):
        if member.scene.layer.half_width is None or member.scene.layer.has_sides:
            continue
        # Not loaded for a layer without a width.
        from underlay.mechanics.finite_width import why_not_ignored  # noqa: PLC0415  see above

        scene, depth = member.scene_at(physical), _deepest(member, member.values_at(physical))
        why = why_not_ignored(scene.layer, scene.substrate, float(law.force(depth)), depth)
        if why:
            yield FitWarning("sides", why)


def _deepest(member: Member, values: Mapping[str, float]) -> float:
    """Largest depth (m) of the tip in a curve's readings: less the contact depth and what the frame gives way.

    `values` are the numbers of the scene (SI) by path.
    """
    compliance, baseline = values["instrument.compliance"], values["instrument.baseline"]
    bent = compliance * max(float(member.curve.force.max()) - baseline, 0.0) if compliance else 0.0
    return float(member.curve.depth.max()) - values["instrument.contact_depth"] - bent


def against_priors(problem: Problem, physical: FloatArray) -> Iterator[FitWarning]:
    """One warning per parameter that ended more than 3.4 prior standard deviations off its prior.

    `physical` are the parameter values (SI), (k,).
    """
    for coordinate, value in zip(problem.coordinates, physical.tolist(), strict=True):
        off = abs(coordinate.prior.penalty(value)[0])
        if off > _CONTRADICTED:
            yield FitWarning(
                "prior",
                f"{coordinate.name} ended {off:.3g} standard deviations of its prior away from it: data and prior "
                "contradict each other, and what is printed is between the two",
            )


def over_correlated(noises: Sequence[NoiseModel], whitened: Sequence[FloatArray]) -> Iterator[FitWarning]:
    """One warning per curve whose noise model assumes more correlation than its whitened residuals (n,) show."""
    for number, (noise, own) in enumerate(zip(noises, whitened, strict=True)):
        if noise.correlation and over_whitened(own):
            yield FitWarning(
                "over-whitened",
                f"{which_curve(number, len(noises))}the whitened residuals alternate: the noise is taken for more "
                "correlated than it is, as where white noise lies on the correlated; the values follow the noise. "
                "Leave the noise out: white and correlated noise are then weighed together",
            )


def _law_range(laws: Sequence[ContactLaw]) -> Iterator[FitWarning]:
    """One warning per curve whose law is used outside its range of validity.

    Depths beyond the thickness of the layer are left to `too_deep`.
    """
    for number, law in enumerate(laws, start=1):
        broken = "; ".join(str(entry) for entry in law.warnings if not isinstance(entry, DeeperThanLayer))
        if broken:
            which = f" on curve {number}" if len(laws) > 1 else ""
            yield FitWarning("law-range", f"{law.method} is used outside its range{which}: {broken}")


def _law_error(problem: Problem, covariance: FloatArray, statistics: FitStatistics) -> Iterator[FitWarning]:
    """One warning per parameter whose standard error is smaller than the law's own relative error of the force.

    That error moves a modulus by as much.
    """
    for coordinate, deviation in zip(problem.coordinates, np.sqrt(np.diag(covariance)), strict=True):
        scales = coordinate.scale is None and not coordinate.path.startswith("noise.")
        if scales and 0.0 < deviation < statistics.law_error:
            yield FitWarning(
                "law-error",
                f"the {statistics.law_method} model may itself be off by {_share(statistics.law_error)} of the "
                f"force, more than the standard error of {coordinate.name} ({100.0 * deviation:.2g} %): use the "
                "exact model",
            )


def _share(error: float) -> str:
    """Return a relative error in words: ``"2.7 %"``; one that is not known has no number."""
    return f"{float(f'{100.0 * error:.2g}'):g} %" if math.isfinite(error) else "an unknown part"
