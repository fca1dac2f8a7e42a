"""What stands behind the numbers of a fit or a posterior: parts for pages and terminals, and the files of a fit.

A part is data (`Part`): sentences, tables and pictures under a title. A page folds it below its sheet, and
``--details`` prints it. `pictures_of` names the pictures that a scene's effects call for; `write_fit` writes them
beside the tables and the full result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from underlay._csv import csv_text
from underlay._files import write_atomic
from underlay.data.segments import LOADING
from underlay.errors import UnderlayError
from underlay.inference.recipe import steps_to_ours
from underlay.inference.sampling.derived import kind_of_quantity
from underlay.inference.uncertainty.answer import NORMAL_95, ModulusCurve, PointwiseModulus
from underlay.report import plots, scene_tables, screen, tables
from underlay.report.labels import label, labelled, listed, start
from underlay.report.limits import advice, distinct_scenes, rivals
from underlay.scene.parameters import kind_of
from underlay.units import format_ends, format_quantity, human_unit, interval_digits, printed, printed_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from underlay.inference.films import StiffnessFit
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.sampling.posterior import Posterior
    from underlay.scene.scene import Scene

# Rows of a table that is read and not plotted.
_ROWS = 10
# Ends farther apart than this have each a unit of its own.
_ONE_UNIT = 1e-3


class Heading(str):
    """A heading over the content that follows it."""

    __slots__ = ()


class Picture(NamedTuple):
    """A picture that is drawn when it is wanted.

    Parameters
    ----------
    name : str
        Its name among the pictures of a page, and in the names of files.
    draw : callable
        Draws into the axes ``ax`` and returns them.
    alt : str
        Text for screen readers.
    title, caption : str
        What stands below it.
    """

    name: str
    draw: Callable[..., Axes]
    alt: str
    title: str = ""
    caption: str = ""


Content: TypeAlias = str | pd.DataFrame | Picture


def picture(kind: str, draw: Callable[..., Axes], name: str = "", **told: str) -> Picture:
    """Return a picture whose texts are those of its kind in ``words.toml``, with what is `told` filled in."""
    return Picture(name or kind, draw, *(text.format(**told) for text in screen.WORDS["pictures"][kind]))


class Part(NamedTuple):
    """One part of what stands behind a result: its title, what it holds in a few words, and its content."""

    title: str
    note: str
    content: Sequence[Content]


def fit_parts(fit: Fit, by_depth: Sequence[PointwiseModulus | str], command: str = "") -> Iterator[Part]:
    """Yield the parts that stand behind the numbers of a fit.

    Parameters
    ----------
    fit : Fit
        The result.
    by_depth : sequence of PointwiseModulus or str
        What `pointwise_of` returns for it.
    command : str
        Command line that repeats the fit; empty where there is none.
    """
    yield _parameters(fit)
    yield Part("Uncertainty budgets", "every source, its size and its origin", [*_budgets(fit)])
    yield Part("E by depth as a table", "from the force and from its slope", [*_depths(by_depth)])
    yield Part("Effects that were considered", "what leaving each one out would change", [*_effects(fit)])
    doubts = tables.reservations_table(fit)
    number = int((doubts["reservation"] != "none").sum())
    yield Part(
        "Quality of the fit",
        f"{number or 'no'} reservation{'' if number == 1 else 's'}",
        [
            *(f"Also {labelled(str(other))}." for other in fit.verdict.others),
            tables.diagnostics_table(fit),
            doubts,
        ],
    )
    yield Part("The test in numbers", "", [scene_tables.scene_table(*fit.scenes)])
    drawn = [pictures_of(fit, curve) for curve in range(len(fit.curves))]
    yield Part("Adhesion", "pull-off, jumps, and the half-space's formula", [*_adhesion(fit, drawn)])
    yield Part(
        "Relaxation",
        "modulus, or what is left of the force, against time",
        [found[name] for found in drawn for name in ("relaxation", "drainage") if name in found],
    )
    yield Part(
        "The whole measurement",
        f"the fit uses a part of it ({LOADING} by default)",
        [found["segments"] for found in drawn if "segments" in found],
    )
    files = {"to repeat": command} if command else {}
    origin = tables.provenance_table(fit.provenance, files)
    yield Part("Where this comes from", "files, hashes, versions", [origin])


def _parameters(fit: Fit) -> Part:
    """Return the parameters, what they leave undetermined, and the steps from the instrument's modulus."""
    content: list[Content] = [tables.interval_table(fit)] if fit.verdict != "reject" else []
    content += [*rivals(fit), *advice(fit)]
    content += [
        f"{start(label(first))} and {label(second)} are known only together (correlation {value:+.3f})."
        for first, second, value in tables.known_together(fit)
    ]
    if pairs := tables.strong_pairs(fit):
        rows = [(f"{first} and {second}", f"{value:+.3f}") for first, second, value in pairs]
        content.append(pd.DataFrame(rows, columns=["parameters", "correlation"]))
    if steps := steps_to_ours(fit):
        content += [
            Heading("From the instrument's number to the value of this fit"),
            tables.steps_table(steps),
        ]
    note = f"{len(fit.names)} fitted{f', {len(pairs)} strongly correlated pairs' if len(pairs) else ''}"
    return Part("Parameters and correlations", note, content)


def _budgets(fit: Fit) -> Iterator[Content]:
    for name in screen.told_names(fit) if fit.verdict != "reject" else ():
        frame = screen.budget_table(fit.answer(name))
        if len(frame):
            yield Heading(start(label(name)))
            yield frame


def _depths(by_depth: Sequence[PointwiseModulus | str]) -> Iterator[Content]:
    for number, found in enumerate(by_depth, start=1):
        if len(by_depth) > 1:
            yield Heading(f"Curve {number}")
        yield pointwise_sentence(found)
        if not isinstance(found, str):
            yield pointwise_table(found)


def _effects(fit: Fit) -> Iterator[Content]:
    """Yield the effects at the deepest point of each scene, without their times, which differ from run to run."""
    for test in distinct_scenes(fit.scenes, fit.curves):
        if test.label:
            yield Heading(start(test.label))
        yield scene_tables.effects_table(test.scene, test.deepest, fit.solver).drop(
            columns="adds to the time"
        )


def _adhesion(fit: Fit, drawn: Sequence[dict[str, Picture]]) -> Iterator[Content]:
    for curve, pictures in enumerate(drawn):
        if "adhesion" in pictures:
            yield pictures["adhesion"]
            yield scene_tables.adhesion_table(fit, curve)
            if sentence := scene_tables.halfspace_of(fit, curve):
                yield sentence


def pictures_of(fit: Fit, curve: int = 0) -> dict[str, Picture]:
    """Return the pictures that the effects of one curve's scene call for, by their names.

    They are ``time``, ``drainage``, ``relaxation`` and ``adhesion``; ``segments`` of a curve that was measured
    beyond what is fitted.
    """
    scene, whole = fit.scenes[curve], tables.beyond_loading(fit.curves[curve])
    draws = {
        "time": partial(plots.fit_in_time, fit, curve=curve) if scene.memory is not None else None,
        "drainage": partial(plots.drainage, fit, curve=curve) if scene.layer.material.drains else None,
        "relaxation": partial(plots.relaxation, fit, curve=curve) if scene.layer.relaxation else None,
        "adhesion": partial(plots.adhesion, fit, curve=curve) if scene.adheres else None,
        "segments": None if whole is None else partial(plots.segments, whole),
    }
    return {name: picture(name, draw, f"{name} {curve}") for name, draw in draws.items() if draw is not None}


def pointwise_of(result: Fit) -> list[PointwiseModulus | str]:
    """Return for every curve of a fit the modulus at each depth or, as text, the reason why there is none."""
    found: list[PointwiseModulus | str] = []
    for curve in range(len(result.curves)):
        try:
            found.append(result.modulus_by_depth(curve))
        except UnderlayError as error:
            found.append(str(error))
    return found


def pointwise_sentence(found: PointwiseModulus | str) -> str:
    """Say at how many depths the modulus read there agrees with the fit's, and what a half-space would give.

    `found` is the modulus at each depth, or the reason why there is none.
    """
    if isinstance(found, str):
        return f"Not read depth by depth: {found}."
    layer, bare = found.apparent, found.apparent_halfspace
    held = int(np.count_nonzero((layer.low <= layer.expected) & (layer.expected <= layer.high)))
    text = (
        f"Read from the force at each depth, the {100.0 * found.level:.0f} % interval holds the fit's modulus, "
        f"{format_quantity(float(layer.expected[-1]), 'pressure')}, at {held} of {len(found.depth)} depths."
    )
    if not found.layered:
        return text
    first, last = (
        f"{format_quantity(float(bare.modulus[end]), 'pressure')} at "
        f"{format_quantity(float(found.depth[end]), 'length')}"
        for end in (0, -1)
    )
    return printed(f"{text} The formula of a half-space reads {first} and {last}.")


def pointwise_table(found: PointwiseModulus) -> pd.DataFrame:
    """Return the modulus at ten of the depths, as text with intervals: from the force and from the slope.

    Where the scene has a layer, columns with the modulus by the half-space formula are added.
    """
    unit, metre = human_unit(float(found.depth[-1]), "length")
    length = printed_unit(unit)
    name, pascal = human_unit(float(found.apparent.expected[-1]), "pressure")
    what = ", layer in the model" if found.layered else ""
    rows = []
    for n in np.unique(np.linspace(0, len(found.depth) - 1, _ROWS).round().astype(int)):
        row = {
            f"depth ({length})": f"{found.depth[n] / metre:.3g}",
            "points": f"{found.points[n]:.0f}",
            f"from the force{what} ({name})": _cell(found.apparent, n, pascal),
            f"from the slope{what} ({name})": _cell(found.incremental, n, pascal),
        }
        if found.layered:
            bare = found.apparent_halfspace
            row[f"from the force, half-space ({name})"] = _cell(bare, n, pascal)
            row["half-space, were the model right"] = f"{bare.expected[n] / pascal:.4g}"
        rows.append(row)
    return tables.labelled_table(rows)


def _cell(curve: ModulusCurve, n: int, pascal: float) -> str:
    value, low, high = (float(column[n]) / pascal for column in (curve.modulus, curve.low, curve.high))
    return "none" if np.isnan(value) else screen.interval_text(value, low, high, "dimensionless")


def posterior_parts(posterior: Posterior, facts: Mapping[str, str], *files: str) -> Iterator[Part]:
    """Yield the parts that stand behind the numbers of a posterior.

    Parameters
    ----------
    posterior : Posterior
        The result.
    facts : mapping of str to str
        What the provenance says besides its own record, e.g. the command that repeats it.
    *files : path
        Files whose SHA-256 the provenance lists.
    """
    names = listed([label(name) for name in posterior.names])
    yield Part("Parameters", names, [posterior_table(posterior)])
    yield Part("The other curves", "", [predicted(posterior, n) for n in range(1, len(posterior.predictive))])
    yield Part("What the data add", "each parameter before and after the test", [prior_table(posterior)])
    yield Part("Diagnostics of the sampling", "", [posterior_diagnostics_table(posterior)])
    scenes = median_scenes(posterior)
    yield Part("The test in numbers", "", [scene_tables.scene_table(*scenes)] if scenes else [])
    yield Part("Where this comes from", "", [tables.provenance_table(posterior.provenance, facts, *files)])


def predicted(posterior: Posterior, curve: int) -> Picture:
    """Return the picture of one curve with the bands of the model and of new readings."""
    return picture("predicted", partial(plots.predictive, posterior, curve=curve), f"predicted {curve}")


def median_scenes(posterior: Posterior) -> tuple[Scene, ...]:
    """Return the scene of each curve at the median of the draws; none of a posterior stored without its problem."""
    problem = posterior.problem
    return () if problem is None else problem.scenes(problem.vector(dict(posterior.samples.median())))


def posterior_table(posterior: Posterior) -> pd.DataFrame:
    """Return one row per parameter and derived quantity as text: value, intervals of the draws, convergence.

    The column ``data`` says how much the data narrowed the prior. The value and its interval are those that `fit`
    prints, with the draws' statistical part; of a posterior that was stored without its problem they are median and
    95 % interval of the draws.
    """
    rows = []
    for name, row in posterior.summary(derived=True).iterrows():
        kind = kind_of_quantity(str(name))
        drawn = (float(row["median"]), float(row["hdi95_low"]), float(row["hdi95_high"]))
        known = None if posterior.problem is None else posterior.answer(str(name))
        stated = drawn if known is None else (known.value, known.low, known.high)
        rows.append(
            {
                "parameter": label(str(name)),
                "value (95 % interval)": screen.interval_text(*stated, kind),
                "median of the samples (95 %)": screen.interval_text(*drawn, kind),
                "68 % interval": _span(row["hdi68_low"], row["hdi68_high"], kind),
                "effective samples": f"{row['ess']:.0f}",
                "R-hat": "" if np.isnan(row["rhat"]) else f"{row['rhat']:.4f}",
                "data": row["informed"],
            }
        )
    return tables.labelled_table(rows)


def _span(low: float, high: float, kind: str) -> str:
    unit, factor = human_unit(min(low, high, key=abs), kind)
    if not abs(low) > _ONE_UNIT * abs(high):
        return " to ".join(format_ends(low, high, kind))
    digits = interval_digits(low, high)
    return f"{low / factor:.{digits}g} to {high / factor:.{digits}g} {unit}".strip()


def prior_table(posterior: Posterior) -> pd.DataFrame:
    """Return 95 % intervals of each parameter before and after the data, and by how much they narrowed (text)."""
    rows = []
    for name, row in posterior.prior_comparison().iterrows():
        kind = kind_of(str(name))
        spans = {
            when: _span(row[f"{key}_low"], row[f"{key}_high"], kind)
            for when, key in (("prior (95 %)", "prior"), ("posterior (95 %)", "posterior"))
        }
        narrowed = f"{100.0 * row['narrowing']:.0f} %"
        rows.append(
            {"parameter": label(str(name)), **spans, "narrowed by": narrowed, "data": row["informed"]}
        )
    return tables.labelled_table(rows)


def posterior_diagnostics_table(posterior: Posterior) -> pd.DataFrame:
    """Return the diagnostics of the sampling, a row each, as text: convergence, effective draws, errors."""
    d = posterior.diagnostics
    judged = {"draws": "weighted, then resampled; a chain begun from them agrees"} if d.weighted else {}
    every = "all others" if d.thin == 1 else f"one in {d.thin}"
    kept = "of the chain that judges" if d.weighted else f"{d.burn_in} dropped, {every} kept"
    errors = "; ".join(
        f"{label(name)} {', '.join(f'{error:.2f}' for error in known)}"
        for name, known in d.quantile_errors.items()
    )
    chain = {
        **judged,
        "steps, walkers": f"{d.steps}, {d.walkers} ({kept})",
        "autocorrelation time": ", ".join(f"{t:.0f}" for t in d.autocorrelation_time) + " steps",
        "R-hat": ", ".join(f"{r:.4f}" for r in d.rhat) or "not asked for",
        "acceptance": f"{100.0 * d.acceptance:.0f} %",
    }
    rows = {
        "converged": "yes" if d.converged else "NO",
        "why it stopped": d.reason,
        **(chain if d.method == "emcee" else {"draws": "weighted, then resampled: no chain"}),
        "effective samples": ", ".join(f"{size:.0f}" for size in d.effective) or "not kept",
        "errors of the 2.5, 50, 97.5 % quantiles": f"{errors} standard deviations" if errors else "not kept",
        **_weighted(posterior),
        "evaluations": f"{d.evaluations}, of which {d.failures} failed",
        "model error": f"{d.model_error:.1e} of the force",
        "data in the 95 % band": ", ".join(
            f"{100.0 * band.coverage():.1f} %" for band in posterior.predictive
        ),
        "seed": "not given" if d.seed is None else str(d.seed),
        "time": f"{d.seconds:.1f} s",
    }
    return tables.facts_table(rows)


def _weighted(posterior: Posterior) -> dict[str, str]:
    """Return rows on the importance-sampling check of the posterior, and on the log evidence it gives."""
    found, evidence = posterior.diagnostics.importance, posterior.log_evidence
    if found is None:
        return {"weighted samples": "none"}
    verdict = (
        f"not used: {found.refused}"
        if found.refused
        else f"they disagree: {found.disagreement}"
        if found.disagreement
        else "used"
    )
    return {
        "weighted samples": (
            f"{found.effective:.0f} effective of {found.draws}, Pareto k {found.k_hat:.2f}; {verdict}"
        ),
        "ln(evidence), 95 %": (
            "not known" if evidence is None else f"{evidence.value:.2f} ± {NORMAL_95 * evidence.error:.2f}"
        ),
    }


def write_fit(result: Fit, folder: Path, stem: str) -> list[Path]:
    """Write the table (CSV), the full result (JSON) and the pictures of a fit; return the paths of the files.

    They begin with `stem`. What is written depends on the scene: see `pictures_of`; the modulus by depth and the
    numbers of an adhesive contact are tables (CSV) of their own.
    """
    # Not loaded by a page, which needs the words and tables of this module alone.
    from underlay.report.excel import result_rows  # noqa: PLC0415  see above

    files: dict[str, pd.DataFrame | Callable[..., Axes]] = {
        "fit.csv": result_rows(result),
        "fit.png": partial(plots.fit, result),
    }
    by_depth = pointwise_of(result)[0]
    if isinstance(by_depth, PointwiseModulus):
        files["depth.csv"] = by_depth.table
    if result.scenes[0].adheres:
        files["adhesion.csv"] = scene_tables.adhesion_frame(result)
    files |= {f"{name}.png": picture.draw for name, picture in pictures_of(result).items()}
    return [
        *write_all(folder, {f"{stem}.{name}": what for name, what in files.items()}),
        result.to_json(folder / f"{stem}.fit.json"),
    ]


def write_posterior(posterior: Posterior, folder: Path, stem: str) -> list[Path]:
    """Write the draws, their summary (CSV) and the pictures of a posterior; return the paths of the files.

    They begin with `stem`.
    """
    draws = folder / f"{stem}.posterior.npz"
    posterior.save(draws)
    files: dict[str, pd.DataFrame | Callable[..., Axes]] = {
        "posterior.csv": posterior.summary().rename_axis("parameter"),
        "corner.png": partial(plots.corner, posterior),
        "predictive.png": partial(plots.predictive, posterior),
    }
    return [draws, *write_all(folder, {f"{stem}.{name}": what for name, what in files.items()})]


def write_film(found: StiffnessFit, folder: Path, stem: str) -> list[Path]:
    """Write both tables (CSV) and the picture (PNG) of a film; return the paths of the three files."""
    units = {name: f"{name} ({unit})" for unit, names in screen.WORDS["film"].items() for name in names}
    files: dict[str, pd.DataFrame | Callable[..., Axes]] = {
        "csv": scene_tables.film_moduli(found),
        "depths.csv": found.table.rename(columns=units),
        "png": partial(plots.film, found),
    }
    return write_all(folder, {f"{stem}.film.{name}": what for name, what in files.items()})


def write_all(folder: Path, files: Mapping[str, pd.DataFrame | Callable[..., Axes]]) -> list[Path]:
    """Write files into a folder by name: tables as CSV, functions as the pictures they draw; return the paths."""
    return [
        plots.save(what(), folder / name) if callable(what) else write_atomic(folder / name, csv_text(what))
        for name, what in files.items()
    ]
