"""The short text of a result: numbers first, one verdict, one next step; at most twelve lines of eighty columns.

Commands, pages and reports print numbers in one form: a value and its expanded uncertainty at 95 %, both rounded to
the same decimal, two digits of uncertainty; a range where the interval is lopsided; an inequality where it has one
open end.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay._door import parse_toml
from underlay.errors import UnderlayError
from underlay.inference.batch.decisions import not_rejected
from underlay.inference.batch.results_table import fitted_names
from underlay.inference.sampling.derived import DERIVED
from underlay.inference.uncertainty.answer import Advice, Answer, Contribution
from underlay.mechanics.relaxation import Prony
from underlay.mechanics.solvers import HalfSpace
from underlay.quantities import curve_of, path_of
from underlay.report.labels import is_of_the_sample, label, labelled, start
from underlay.scene.parameters import declared, kind_of
from underlay.units import format_quantity, human_unit

if TYPE_CHECKING:
    from underlay.data.curve import Curve
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.sampling.diagnostics import SamplingDiagnostics
    from underlay.inference.sampling.posterior import Posterior
    from underlay.inference.uncertainty.answer import PointwiseModulus

#: Width of the column of names.
_LEFT = 16
_WIDTH = 80
# One arm of an interval that is so much longer than the other is told as a range.
_LOPSIDED = 1.5
# Decimals that an end near zero may add.
_MORE = 4
# Inputs that are named, largest first, and the share below which none is: without it the whole is 5 % smaller.
_NAMED, _SMALL = 3, 0.1
#: What is said in a word or two, by kind and key.
WORDS: Mapping[str, Mapping[str, Any]] = parse_toml(
    (resources.files("underlay.report") / "templates" / "words.toml").read_text(encoding="utf-8")
)


def line(name: str, text: str) -> str:
    """Return `name` in the left column and `text`, wrapped, in the right one; a long name has a line of its own."""
    if len(name) >= _LEFT:
        return f"{name}\n{line('', text)}"
    folded = textwrap.wrap(text, _WIDTH - _LEFT, break_long_words=False, break_on_hyphens=False) or [""]
    return "\n".join(f"{name if n == 0 else '':<{_LEFT}}{part}".rstrip() for n, part in enumerate(folded))


# --- one number ---------------------------------------------------------------------------------------------
class _Written(NamedTuple):
    """The parts of a printed number: ``"0.617 ± 0.037"``, ``"MPa"``, ``"95 %"``, ``"0.009"``, ``"0.036"``.

    The last two are half widths of the statistical and systematic parts, in the same unit; of a lopsided interval
    the longer arms, and `reach` is ``"up to "``.
    """

    number: str
    unit: str
    level: str
    statistical: str
    systematic: str

    @property
    def reach(self) -> str:
        """What stands before the two parts: nothing, or ``"up to "``."""
        return "" if "±" in self.number else "up to "


def written(known: Answer) -> _Written:
    """Return the printed parts of a number and its interval, whose ends must both be finite."""
    unit, factor = human_unit(known.value, kind_of(path_of(known.name)))
    number = _with_ends(*(end / factor for end in (known.value, known.low, known.high)))
    own = [
        _two_digits(max(known.value - part.low, part.high - known.value) / factor)
        for part in (known.statistical, known.systematic)
    ]
    return _Written(number, unit, f"{100.0 * known.level:.3g} %", *own)


def _with_ends(value: float, low: float, high: float) -> str:
    """Write a value with its interval: ``"0.617 ± 0.037"``, or ``"0.62 (0.52 to 0.81)"`` where it is lopsided."""
    arms = value - low, high - value
    if max(arms) <= _LOPSIDED * min(arms):
        decimals = _decimals(max(arms))
        return f"{value:.{decimals}f} ± {max(arms):.{decimals}f}"
    decimals = _decimals(min(arm for arm in (*arms, max(arms)) if arm > 0.0))
    # An end near zero is not read as zero.
    decimals += next((n for n in range(_MORE) if not _misread((low, high), decimals + n)), 0)
    # Nor is one far away known to its last place.
    ends = [_rounded(end, min(decimals, _place(arm) + 1)) for end, arm in zip((low, high), arms, strict=True)]
    return f"{value:.{decimals}f} ({ends[0]} to {ends[1]})"


def _misread(ends: Iterable[float], decimals: int) -> bool:
    """Whether rounding to so many decimals changes an end by more than a quarter: 0.00 for 0.0048."""
    return any(abs(round(end, decimals) - end) > 0.25 * abs(end) for end in ends)


def interval_text(value: float, low: float, high: float, kind: str) -> str:
    """Write a value (SI) with its interval: ``"0.420 ± 0.020 MPa"``, or ``"1.5 mm (> 1.1 mm)"`` for an open end.

    `kind` is the kind of quantity, such as ``"pressure"``.
    """
    if math.isfinite(low) and math.isfinite(high):
        unit, factor = human_unit(value, kind)
        return f"{_with_ends(value / factor, low / factor, high / factor)} {unit}".rstrip()
    end = one_end(low, high, kind)
    return f"{format_quantity(value, kind)}{f' ({end})' if end else ''}"


def answer_text(known: Answer, *, parts: bool = True) -> str:
    """Write a fitted number with its uncertainty: ``"0.617 ± 0.037 MPa (95 %; stat 0.009, syst 0.036)"``.

    Where the interval is lopsided it is ``"0.62 (0.52 to 0.81) MPa (95 %; stat <0.01, syst <0.19)"``, with the
    longer arms of the parts, and where it has an open end ``"not determined by this curve (> 1.1 mm)"``. Without
    `parts` the brackets with level and parts are left out.
    """
    if known.is_open:
        end = one_end(known.low, known.high, kind_of(path_of(known.name)))
        return f"not determined by this curve{f' ({end})' if end else ''}"
    one = written(known)
    text = f"{one.number} {one.unit}".rstrip()
    sign = "<" if one.reach else ""
    return (
        f"{text} ({one.level}; stat {sign}{one.statistical}, syst {sign}{one.systematic})" if parts else text
    )


def one_end(low: float, high: float, kind: str) -> str:
    """Write the one finite end (SI) of an interval: ``"> 1.1 mm"``; empty where there is none."""
    if math.isfinite(low):
        return f"> {format_quantity(low, kind)}"
    return f"< {format_quantity(high, kind)}" if math.isfinite(high) else ""


def _decimals(width: float) -> int:
    """Return the number of decimals that show two digits of a width; 3 for zero or an infinite one."""
    return max(0, _place(width)) if 0.0 < width < math.inf else 3


def _place(width: float) -> int:
    """Return the decimal place of the second digit of a width: 2 for 0.037, -2 for 4900; 3 for zero."""
    return 1 - math.floor(math.log10(width)) if width > 0.0 else 3


def _rounded(number: float, place: int) -> str:
    """Return a number rounded to a decimal place, which is negative for tens."""
    return f"{round(number, place):.{max(0, place)}f}"


def _two_digits(width: float) -> str:
    return _rounded(width, _place(width)) if width > 0.0 else "0"


def _answer_lines(answers: Iterable[Answer], verdict: Advice) -> Iterator[str]:
    """Yield one line per number of the sample; without an uncertainty where the model was rejected."""
    for known in answers:
        name, symbol = name_of(known.name)
        text = (
            f"{format_quantity(known.value, kind_of(path_of(known.name)))} (model rejected: no uncertainty given)"
            if verdict == "reject"
            else answer_text(known)
        )
        separator = "" if text.startswith("not") else f"{symbol} = "
        yield line(name, f"{separator}{text}")


def name_of(parameter: str) -> tuple[str, str]:
    """Return short name and letter of a parameter: ``"layer.E[1]"`` -> ``("Layer modulus 2", "E")``."""
    short, curve = WORDS["numbers"].get(path_of(parameter)), curve_of(parameter)
    if short is None:
        return start(label(parameter)), _letter(parameter)
    return f"{short[0]}{'' if curve is None else f' {curve + 1}'}", short[1]


def _letter(name: str) -> str:
    """Return the letter of a parameter in plain text, such as E, h or nu; ``"value"`` where it has none."""
    path = path_of(name)
    last = path.rpartition(".")[2]
    letter = {"layer.thickness": "h", "substrate.E": "Es"}.get(path, last)
    known = DERIVED.get(last) or declared(path)
    if known is declared(path) and known.label and len(letter) < 8:
        return letter
    return re.sub(r"[\\_{}]", "", known.symbol) or "value"


# --- a verdict ----------------------------------------------------------------------------------------------
def verdict_lines(verdict: Advice) -> Iterator[str]:
    """Yield the line of the verdict, then those of its likely cause and the next step where it has them."""
    yield line("Verdict", f"{verdict.word}: {labelled(verdict.reason)}")
    if verdict.cause:
        yield line("Likely cause", labelled(verdict.cause))
    if verdict.next:
        yield line("Next step", _next_step(verdict))


def _next_step(verdict: Advice) -> str:
    """Return the next step as text, with the key and value to write into the scene file where it is a setting."""
    if not verdict.setting:
        return labelled(verdict.next)
    path, value = verdict.setting
    # A number that is to be fitted stands in [fit] by its whole path.
    section, _, key = path.partition(".") if path.startswith("fit.") else path.rpartition(".")
    written = value if value == "{}" else f'"{value}"'
    also = ", and rigid = true in [substrate]" if path == "layer.thickness" else ""
    return f"{labelled(verdict.next)}: {key} = {written} in [{section}]{also}"


# --- a budget -----------------------------------------------------------------------------------------------
def source_words(source: str) -> str:
    """Return the name for people of a source of uncertainty: ``"spring_constant"`` -> ``"spring constant"``."""
    return WORDS["sources"].get(source) or (label(source) if "." in source else source)


def _budget_lines(known: Answer) -> Iterator[str]:
    """Yield the largest sources of a number's uncertainty, and a note on those assumed; either may be missing."""
    rows = [row for row in known.contributions if row.share >= _SMALL][:_NAMED]
    told = [
        f"{100.0 * row.share:.0f} % {source_words(row.source)}{'*' if row.origin == 'assumed' else ''}"
        for row in rows
    ]
    assumed = [
        f"{source_words(row.source)} {row.size}" for row in rows if row.origin == "assumed" and row.size
    ]
    if told:
        yield line(f"Variance of {name_of(known.name)[1]}", "; ".join(told))
    if assumed:
        yield line("", f"* assumed ({', '.join(assumed)}): state yours")


def budget_table(known: Answer) -> pd.DataFrame:
    """Return the uncertainty budget of a number as text, a row per source.

    Columns: source, origin, uncertainty of the input, by how much it moves the number, share of the variance.
    """
    kind = kind_of(path_of(known.name))

    def moves(row: Contribution) -> str:
        if not math.isfinite(row.half_width):
            return "open"
        moved = format_quantity(row.half_width, kind)
        return f"{moved} ({100.0 * row.half_width / abs(known.value):.2g} %)" if known.value else moved

    rows = [
        {
            "source": start(source_words(row.source)),
            "origin": row.origin,
            "input": row.size,
            "moves it by": moves(row),
            "variance": f"{100.0 * row.share:.0f} %",
        }
        for row in known.contributions
    ]
    return pd.DataFrame(rows)


def assumed_inputs(curves: Iterable[Curve]) -> list[str]:
    """Return paths of the scene's inputs for which a usual value was taken, as no one measured them."""
    return list(dict.fromkeys(path for curve in curves for path in curve.metadata.get("assumed", ())))


def assumed_words(paths: Iterable[str]) -> str:
    """Say that these inputs (paths) have usual values rather than measured ones; empty for no paths."""
    named = ", ".join(map(label, paths))
    return f"{named}: usual values, not measured; enter yours" if named else ""


# --- a fit --------------------------------------------------------------------------------------------------
def fit_lines(fit: Fit) -> list[str]:
    """Return the short text of a fit, by lines: numbers, verdict, next step, modulus by depth, uncertainty."""
    return "\n".join(_fit_lines(fit)).splitlines()


def _fit_lines(fit: Fit) -> Iterator[str]:
    answers, verdict = [fit.answer(name) for name in told_names(fit)], fit.verdict
    yield from _answer_lines(answers, verdict)
    relaxation, lowest = fit.scene.layer.relaxation, float(fit.curves[0].force.min())
    if isinstance(relaxation, Prony):
        shares = ", ".join(f"{100.0 * share:.0f} %" for share in relaxation.fractions)
        times = ", ".join(format_quantity(time, "time") for time in relaxation.times)
        many = "s" if len(relaxation.times) > 1 else ""
        yield line("Relaxation", f"{shares} with time constant{many} {times}")
    pull = fit.scenes[0].instrument.baseline - lowest
    if fit.scenes[0].adheres and pull > 0.0:
        yield line("Pull-off", f"{format_quantity(pull, 'force')}: the lowest force against the baseline")
    yield from verdict_lines(verdict)
    try:
        words = by_depth_words(fit.modulus_by_depth())
    except UnderlayError:
        words = ""
    if words:
        relaxes = any(path_of(name) == "layer.instantaneous_modulus" for name in fit.derived)
        # Intervals of a rejected model are no judge of whether it is constant.
        shown = words.partition(",")[0] if verdict == "reject" else words
        yield line(f"{'E0' if relaxes else 'E'} by depth", shown)
    yield from _behind(answers, fit)
    # Where a next step is printed, that goes before a comparison.
    if verdict == "good" and (own := half_space_fit(fit)) is not None:
        yield line("Half-space", half_space_words(fit, own))


def _behind(answers: list[Answer], fit: Fit) -> Iterator[str]:
    """Yield how the first number was corrected and what makes it unsure, and which inputs are assumed."""
    if answers and fit.verdict != "reject":
        yield from (line("Corrected", note) for note in answers[0].notes)
        yield from _budget_lines(answers[0])
    if words := assumed_words(assumed_inputs(fit.curves)):
        yield line("Assumed", words)


def told_names(fit: Fit) -> list[str]:
    """Return the names of the sample's fitted and derived parameters, each once.

    The moduli of a relaxing layer come first: they replace its ``layer.E`` and relaxation parameters.
    """
    names = [name for name in (*fit.names, *fit.derived) if is_of_the_sample(name)]
    derived = {path_of(name).rpartition(".")[2] for name in fit.derived}
    if "instantaneous_modulus" not in derived:
        return names
    others = [name for name in names if path_of(name) != "layer.E" and ".relaxation." not in name]
    return sorted(others, key=lambda name: name not in fit.derived)


def by_depth_words(found: PointwiseModulus) -> str:
    """Write the range of the modulus read at each depth, and whether it is constant, rising or falling.

    Empty where fewer than three depths have an interval.
    """
    curve = found.apparent
    known = np.isfinite(curve.modulus) & np.isfinite(curve.low) & np.isfinite(curve.high)
    if known.sum() < 3:
        return ""
    modulus, width = curve.modulus[known], np.log(curve.high[known] / curve.low[known])
    # Depths at which the interval says something: within three times the narrowest.
    told = modulus[width <= 3.0 * width.min()]
    least, most = float(told.min()), float(told.max())
    shown = _range(least, most)
    if found.trend == "constant" or " to " not in shown:
        return f"{shown}, constant within its uncertainty"
    hidden = math.log(most / least) < 0.5 * abs(found.change)
    return f"{shown}, {found.trend}{'; what else was fitted hides most of it' if hidden else ''}"


def _range(least: float, most: float) -> str:
    """Write two moduli (Pa): ``"0.611 to 0.620 MPa"``; one number where both are the same to three digits."""
    unit, factor = human_unit(most, "pressure")
    decimals = max(0, 2 - math.floor(math.log10(most / factor)))
    low, high = f"{least / factor:.{decimals}f}", f"{most / factor:.{decimals}f}"
    return f"{high} {unit}" if low == high else f"{low} to {high} {unit}"


def half_space_fit(fit: Fit) -> Fit | None:
    """Fit the same curve by the half-space formula (no substrate), for comparison.

    None for a joint fit, for a scene without a substrate, with adhesion, relaxation, drainage or a history, where
    the layer's modulus is not fitted, and where the fit fails.
    """
    problem = fit.problem
    alone = len(problem.members) == 1 and fit.scene.substrate is not None and fit.scene.memory is None
    if not alone or "layer.E" not in fit.names or fit.scene.adheres:
        return None
    free = {
        path: given for path, given in problem.free.items() if path.startswith(("layer.E", "instrument."))
    }
    try:
        return fit.refit(problem.revised(free=free, solver=HalfSpace(), scenes=fit.scenes))
    except UnderlayError:
        return None


def half_space_words(fit: Fit, own: Fit) -> str:
    """Say by how much the modulus of the half-space fit `own` deviates from that of `fit`, and why."""
    value = own.values["layer.E"]
    change = 100.0 * (value / fit.answer("layer.E").value - 1.0)
    if abs(change) < 1.0:
        return "Hertz would give the same within 1 %: the substrate is not felt"
    felt = "stiffened" if change > 0.0 else "softened"
    return f"Hertz would give {format_quantity(value, 'pressure')} ({change:+.0f} %): {felt} by the substrate"


def written_line(paths: Sequence[object], folder: object, stem: str) -> str:
    """Return one line on where the written files are: folder, common stem of their names, and their endings."""
    endings = " ".join(sorted({Path(str(path)).name.removeprefix(stem) for path in paths}))
    return line("Written", f"{folder}/{stem} ({endings})")


# --- a posterior --------------------------------------------------------------------------------------------
def posterior_lines(posterior: Posterior) -> list[str]:
    """Return the short text of a posterior, by lines: numbers as of a fit, verdict, budget, and the sampling.

    It must hold the fit it was sampled from (`posterior.statement`).
    """
    verdict, fit = posterior.verdict, posterior.statement.fit
    answers = [posterior.answer(name) for name in told_names(fit)]
    lines = [*_answer_lines(answers, verdict), *verdict_lines(verdict)]
    lines += _behind(answers if verdict != "reject" else [], fit)
    told = posterior.summary()["informed"]
    silent = [start(label(str(name))) for name in told.index[told == "not informed by these data"]]
    if silent:
        lines.append(line("Not informed", f"{', '.join(silent)}: what was known before"))
    lines.append(line("Sampling", _sampling(posterior.diagnostics)))
    return "\n".join(lines).splitlines()


def _sampling(told: SamplingDiagnostics) -> str:
    """Write the smallest number of effective samples of any parameter; where not converged, the reason."""
    if not told.converged or not told.effective:
        return told.reason
    chains = f", R-hat {max(told.rhat):.3f}" if told.rhat else ""
    return f"{min(told.effective):.0f} effective samples{chains}, {told.seconds:.2g} s"


# --- a map --------------------------------------------------------------------------------------------------
def map_lines(table: pd.DataFrame) -> list[str]:
    """Return the short text of a map, by lines: median of each number, uncertainty of one curve, verdicts."""
    trusted, of = not_rejected(table), counted_words(table)
    lines: list[str] = []
    for name in (name for name in fitted_names(table.columns) if is_of_the_sample(name)):
        if not np.isfinite(table[name].to_numpy(dtype=float)).any():
            continue
        own, letter = name_of(name)
        if not len(trusted):
            lines.append(line(own, f"no number: {of}"))
            continue
        if not np.isfinite(trusted[name].to_numpy(dtype=float)).any():
            continue
        sites = site_numbers(trusted, name)
        if sites.is_open == len(trusted):
            lines.append(line(own, "not determined by any curve"))
            continue
        lines.append(line(own, f"median {letter} = {sites.median}, middle half {sites.half} ({of})"))
        lines += [line("One curve", sites.each)] if sites.each else []
        lines += (
            [line("", f"not determined by {sites.is_open} of {len(trusted)} curves")] if sites.is_open else []
        )
    lines.append(line("Curves", f"{len(table)}: {verdict_counts(table)}"))
    if "layer.E.syst.low" in table.columns:
        lines.append(
            line("Shared by all", "errors of inputs and model shift all curves alike: no mean reduces them")
        )
    return "\n".join(lines).splitlines()


def counted_words(table: pd.DataFrame) -> str:
    """Say how many curves the numbers of a map are made of: ``"6 curves; 1 rejected is left out"``."""
    kept, fitted = len(not_rejected(table)), int((table["status"] == "fitted").sum())
    left = fitted - kept
    if not kept:
        return f"the model is rejected for {counted(left, 'curve')}, and no other has a fit"
    out = f"; {left} rejected {'is' if left == 1 else 'are'} left out" if left else ""
    return f"{counted(kept, 'curve')}{out}"


def counted(number: int, what: str) -> str:
    """Return a number of things: ``"1 animal"``, ``"2 animals"``."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def verdict_counts(table: pd.DataFrame) -> str:
    """Count the verdicts of a map: ``"4 good, 1 check, 0 reject, 1 without a fit"``."""
    counts, failed = table["verdict"].value_counts(), int((table["status"] != "fitted").sum())
    told = [f"{counts.get(word, 0)} {word}" for word in ("good", "check", "reject")]
    return ", ".join([*told, *([f"{failed} without a fit"] if failed else [])])


class SiteNumbers(NamedTuple):
    """One column of a map over its sites, as text.

    Parameters
    ----------
    median, half : str
        ``"0.99 MPa"`` and the interquartile range, ``"0.91 to 1.11 MPa"``.
    each : str
        Median uncertainty of one curve, ``"± 0.079 MPa (95 %; stat 0.005, syst 0.079)"``; empty where the table has
        none.
    is_open : int
        How many curves do not determine the number.
    """

    median: str
    half: str
    each: str
    is_open: int


def site_numbers(curves: pd.DataFrame, name: str) -> SiteNumbers:
    """Return median, interquartile range and uncertainty of one curve for a column of a map with finite values."""
    values = curves[name].to_numpy(dtype=float)
    low, middle, high = (
        float(value) for value in np.quantile(values[np.isfinite(values)], [0.25, 0.5, 0.75])
    )
    unit, factor = human_unit(middle, kind_of(name))
    decimals = _decimals(max((high - low) / factor, 0.1 * abs(middle / factor)))
    first, *ends = (f"{value / factor:.{decimals}f}" for value in (middle, low, high))
    each, is_open = "", np.zeros(len(curves), dtype=bool)
    if f"{name}.low" in curves.columns:
        widths = [_half_widths(curves, f"{name}{part}") for part in ("", ".stat", ".syst")]
        is_open = np.isinf(widths[0])
        if not is_open.all():
            own, stat, syst = (_two_digits(float(np.median(width[~is_open])) / factor) for width in widths)
            each = f"{f'± {own} {unit}'.rstrip()} (95 %; stat {stat}, syst {syst})"
    return SiteNumbers(
        f"{first} {unit}".rstrip(), f"{' to '.join(ends)} {unit}".rstrip(), each, int(is_open.sum())
    )


def _half_widths(fitted: pd.DataFrame, name: str) -> FloatArray:
    """Return half the interval width of every curve (SI); infinite where an end is missing in the table."""
    low, high = fitted[[f"{name}.low", f"{name}.high"]].to_numpy(dtype=float).T
    return np.where(np.isnan(low) | np.isnan(high), np.inf, 0.5 * (high - low))
