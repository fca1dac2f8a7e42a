"""A paragraph on a fit for the methods section of a paper, with its references."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from underlay._version import VERSION
from underlay.inference.citation import Work, work
from underlay.mechanics.body import RIGID
from underlay.quantities import numbers_of
from underlay.report import screen
from underlay.report.labels import label, labelled, listed, start
from underlay.report.scene_tables import number_rows
from underlay.units import format_quantity

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.uncertainty.answer import Answer, PointwiseModulus
    from underlay.scene.scene import Scene

# Sources that are named, largest first, and the share of the variance below which none is.
_NAMED, _SMALL = 4, 0.01


def tip_words(scene: Scene) -> str:
    """Return the tip in words: ``"sphere, radius 1 mm"``."""
    numbers = [f"{row['quantity']} {row['value']}" for row in number_rows("", scene.indenter)]
    return ", ".join([scene.indenter.shape.replace("_", " "), *numbers[:2]])


def sample_words(scene: Scene) -> str:
    """Return the sample in words: ``"a layer bonded to a rigid substrate"``."""
    if scene.substrate is None:
        return "a half-space"
    what = "a layer" if len(scene.layers) == 1 else f"{len(scene.layers)} layers"
    bond = {"bonded": "bonded to", "slip": "free to slip on"}.get(str(scene.layer.bond), "on")
    under = "a rigid substrate" if scene.base == RIGID else "an elastic substrate"
    return f"{what} {bond if len(scene.layers) == 1 else 'on'} {under}"


def cited_works(used: Mapping[str, str]) -> list[Work]:
    """Return the works to cite for an analysis.

    Parameters
    ----------
    used : mapping of str to str
        Keys of works, and what each was used for. What every analysis uses (arrays, numerics, ...) is left out:
        `underlay cite` lists it.
    """
    return [
        work(key) for key, why in used.items() if not why.startswith(tuple(screen.WORDS["methods"]["common"]))
    ]


def methods_paragraph(
    fit: Fit, by_depth: PointwiseModulus | None = None, half_space: Fit | None = None
) -> str:
    """Return a paragraph for the methods section of a paper: model, parameters, numbers with uncertainty.

    `by_depth` (modulus at each depth) and `half_space` (the fit without the substrate) add a sentence each.
    """
    answers = [fit.answer(name) for name in screen.told_names(fit)]
    # The first number also states the sources of its uncertainty.
    numbers = [_number(known, whole=place == 0) for place, known in enumerate(answers)]
    sentences = [_model(fit), _parameters(fit), *numbers]
    if by_depth is not None and (trend := screen.by_depth_words(by_depth)):
        sentences.append(f"Read from the force at each depth the modulus was {trend}.")
    if half_space is not None:
        value = format_quantity(half_space.values["layer.E"], "pressure")
        sentences.append(f"A half-space (Hertz) model would have given {value}.")
    if fit.verdict != "good":
        sentences.append(f"The analysis notes: {labelled(fit.verdict.reason)}.")
    return " ".join(sentences)


def _model(fit: Fit) -> str:
    scene, number = fit.scene, len(fit.curves)
    curves = (
        "A force-indentation curve was" if number == 1 else f"{number} force-indentation curves were jointly"
    )
    law = screen.WORDS["laws"].get(
        fit.statistics.law_method, f"the contact model {fit.statistics.law_method}"
    )
    cited = citation_words(cited_works(fit.used))
    return f"{curves} fitted with {law} for a {tip_words(scene)}, on {sample_words(scene)} ({cited})."


def citation_words(works: Sequence[Work]) -> str:
    """Return this program and the works it followed, with their numbers: ``"underlay 1.0 [1]; after [2]"``."""
    after = ", ".join(f"[{n}]" for n in range(2, len(works) + 1))
    return f"underlay {VERSION} [1]{f'; after {after}' if after else ''}"


def _parameters(fit: Fit) -> str:
    free = listed([label(name) for name in fit.names if not name.startswith("noise.")])
    parts = {"layer": fit.scene.layer.material, "substrate": fit.scene.base}
    fixed = {
        path: f"{label(path)} ({format_quantity(known.value, known.quantity.kind)})"
        for part, owner in parts.items()
        if owner is not None
        for path, known in numbers_of(owner, part).items()
        if not any(name.partition("[")[0] == path for name in fit.names)
    }
    if fit.scene.substrate is not None and "layer.thickness" not in fit.names:
        thick = format_quantity(fit.scene.layer.thickness, "length")
        fixed["layer.thickness"] = f"layer thickness ({thick})"
    assumed = screen.assumed_inputs(fit.curves)
    given = [words for path, words in fixed.items() if path not in assumed]
    guessed = [fixed.get(path, label(path)) for path in assumed]
    told = [(free, len(fit.names), "fitted")]
    told += [(listed(given), len(given), "given")] if given else []
    told += [(listed(guessed), len(guessed), "assumed, not measured")] if guessed else []
    said = "; ".join(f"{names} {'was' if count == 1 else 'were'} {how}" for names, count, how in told)
    return f"{start(said)}."


def _number(known: Answer, *, whole: bool) -> str:
    name, letter = label(known.name), screen.name_of(known.name)[1]
    if known.is_open:
        return f"The {name} was not determined."
    one = screen.written(known)
    kind = "expanded uncertainty, k = 2, about 95 %" if "±" in one.number else f"{one.level} interval"
    text = f"The {name} was {letter} = {one.number} {one.unit}".rstrip()
    if not whole:
        return f"{text} ({one.level})."
    return (
        f"{text} ({kind}), from a statistical part of {one.reach}{one.statistical} {one.unit} (noise and misfit of "
        f"the curve) and a systematic part of {one.reach}{one.systematic} {one.unit}{_sources(known)}."
    )


def _sources(known: Answer) -> str:
    rows = [row for row in known.contributions if row.share >= _SMALL and row.origin != "seen"][:_NAMED]
    if not rows:
        return ""
    assumed = [screen.source_words(row.source) for row in rows if row.origin == "assumed"]
    note = f"; the uncertainty of {listed(assumed)} was assumed" if assumed else ""
    return f" ({listed([screen.source_words(row.source) for row in rows])}{note})"
