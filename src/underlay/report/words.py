"""Results in sentences: what was found, how sure it is, and what the test does not tell."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from underlay._arrays import ArrayLike
from underlay._text import one_line
from underlay.inference.headline.known_inputs import FORCE
from underlay.inference.uncertainty.known_errors import known_errors
from underlay.report.intervals import (
    Estimate,
    doubts_of_curves,
    estimates,
    is_averaged,
    quantity_with_interval,
    standing,
    wide_interval,
)
from underlay.report.labels import is_of_the_sample, label, labelled, start
from underlay.report.limits import advice, distinct_scenes, model_limits, rivals
from underlay.report.spoken import markdown_text
from underlay.scene.parameters import kind_of
from underlay.units import format_quantity, human_unit, printed

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.sampling.posterior import Posterior

__all__ = [
    "headline",
    "known_together",
    "noted",
    "posterior_summary",
    "stands_on",
    "strong_pairs",
    "summary",
    "verdict_sentence",
]

#: Above this, two parameters are not known one by one, only together.
STRONG = 0.9
#: Confidence of the intervals in a sentence.
_LEVEL = 0.95
# A standard error of the logarithm above which a parameter is badly known by itself.
_BADLY = 0.05
# A change of the force below this is not worth a sentence.
_NOTICEABLE = 0.01


def headline(result: Fit) -> str:
    """Return the result in one sentence per parameter of the sample.

    Examples
    --------
    ``"Layer modulus 0.420 MPa (0.400 to 0.440, 95 %). Layer thickness is not fixed by this test."``; where friction
    or finite strain could do something, ``"Layer modulus 0.620 MPa (0.608 to 0.632 from the noise; with friction
    and finite strain unknown 0.571 to 0.664, 95 %)."``
    """
    return " ".join([*map(_sentence, _of_the_sample(result)), *_bonds(result)])


def summary(result: Fit) -> str:
    """Return the result as Markdown: numbers, verdict, inputs, rivals, what holds together, substrate, doubts."""
    lines = [f"**{text}**" for text in (*map(_sentence, _of_the_sample(result)), *_bonds(result))]
    paragraphs = [" ".join(lines), f"**{verdict_sentence(result)}**", stands_on(result)]
    paragraphs += [*model_limits(result), *advice(result), *rivals(result)]
    paragraphs += [
        f"{start(label(first))} and {label(second)} are known only together (correlation {value:+.3f}): "
        f"if one is wrong, so is the other."
        for first, second, value in known_together(result)
        if is_of_the_sample(first) and is_of_the_sample(second)
    ]
    paragraphs += [_substrate_sentence(result), _width_sentence(result), _narrowness_sentence(result)]
    paragraphs.append(_reservation_sentence(result))
    return printed("\n\n".join(text for text in paragraphs if text))


def _of_the_sample(result: Fit) -> list[Estimate]:
    """What a headline tells, each once: the E of a Prony series is the modulus at once."""
    found = [entry for entry in estimates(result) if is_of_the_sample(entry.name)]
    names = {entry.name for entry in found}
    return [
        entry
        for entry in found
        if "instantaneous_modulus" not in entry.name
        or entry.name.replace("instantaneous_modulus", "E") not in names
    ]


def verdict_sentence(result: Fit) -> str:
    """Return the verdict with its reasons, parameters by their words: ``"Verdict: good."``."""
    return f"Verdict: {markdown_text(labelled(one_line(result.verdict), result.names))}."


def stands_on(result: Fit) -> str:
    """Return what 1 % in each number taken as known does to the first modulus or other value; "" if nothing.

    Examples
    --------
    ``"1 % more in indenter radius changes layer modulus by -0.39 %, ... no residual shows such an error: where one
    of these is uncertain, free it with a Normal prior."``
    """
    for name, moved in result.sensitivity.items():
        told = [
            f"{path if path == FORCE else label(path)} by {share:+.2g} %"
            for path, share in moved.items()
            if abs(share) >= _NOTICEABLE
        ]
        if told:
            return (
                f"What {label(name)} stands on: 1 % more in the following moves it, in {'; in '.join(told)}. No "
                "residual shows such an error: free what is uncertain with a Normal prior of its uncertainty."
            )
    return ""


# Of posteriors in which disturbances of a curve take part.
_LAW_ALONE = (
    "No noise was stated: it is averaged over, and with it all that may disturb the curve. Bands of the contact "
    "law leave these disturbances out, and are wider than what the data leave open of their sum."
)


def posterior_summary(posterior: Posterior) -> str:
    """Return a posterior as Markdown: answers, and what the data did not inform."""
    table = posterior.summary()
    parts = []
    for name, row in table.iterrows():
        ends = row["median"], row["hdi95_low"], row["hdi95_high"]
        if posterior.problem is not None:
            known = posterior.answer(str(name))
            ends = known.value, known.low, known.high
        text = quantity_with_interval(*ends, kind_of(str(name)))
        sentence = f"{start(label(str(name)))} {_with_level(text)}."
        if row["informed"] == "not informed by these data":
            sentence = (
                f"{start(label(str(name)))} is not informed by these data: {_with_level(text)} is what was "
                "known before."
            )
        if is_of_the_sample(str(name)):
            parts.append(f"**{sentence}**")
    d = posterior.diagnostics
    state = "The sampling converged" if posterior.converged else "**The sampling did not converge**"
    reason = markdown_text(d.reason.removeprefix("converged: ").rstrip("."))
    told = [" ".join(parts), f"{state}: {reason}."]
    if posterior.problem is not None and posterior.problem.noise_is_open:
        told.append(_LAW_ALONE)
    return "\n\n".join(told)


def noted(message: object, *_: object) -> str:
    """Return a warning as a line of a report: takes the place of `warnings.formatwarning`."""
    return f"note: {one_line(message)}\n"


def strong_pairs(result: Fit) -> list[tuple[str, str, float]]:
    """Pairs of parameters whose correlation is above 0.9 in size, strongest first."""
    frame = result.correlations
    matrix, names = frame.to_numpy(), [str(name) for name in frame.columns]
    pairs = [
        (names[j], names[i], float(matrix[i, j]))
        for i in range(len(names))
        for j in range(i)
        if abs(matrix[i, j]) > STRONG
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def known_together(result: Fit) -> list[tuple[str, str, float]]:
    """Those of `strong_pairs` that are badly known one by one, and well if the other were known."""
    index = {name: i for i, name in enumerate(result.names)}
    pairs = []
    for first, second, value in strong_pairs(result):
        errors = [
            math.sqrt(float(result.scaled_covariance[index[name], index[name]])) for name in (first, second)
        ]
        if max(errors) > _BADLY and max(errors) * math.sqrt(max(1.0 - value * value, 0.0)) < _BADLY:
            pairs.append((first, second, value))
    return pairs


def _with_level(text: str) -> str:
    return f"{text[:-1]}, 95 %)" if text.endswith(")") else text


def _sentence(entry: Estimate) -> str:
    if entry.not_fixed:
        return f"{start(label(entry.name))} is not fixed by this test ({entry.not_fixed})."
    kind, words = kind_of(entry.path), start(label(entry.name))
    if math.isinf(entry.high):
        told = _one_end(entry, "more than", entry.low, entry.wide_low, kind)
        return f"{words} is {told} (95 %); the data set no upper end."
    if math.isinf(entry.low):
        told = _one_end(entry, "less than", entry.high, entry.wide_high, kind)
        return f"{words} is {told} (95 %); the data set no lower end."
    text = quantity_with_interval(entry.value, entry.low, entry.high, kind)
    if entry.left_out:
        unknown = wide_interval(entry, kind) or "anything"
        text = f"{text[:-1]} from the noise; with {_listed(entry)} unknown {unknown})"
    return f"{words} {_with_level(text)}."


def _one_end(entry: Estimate, word: str, end: float, wide: float, kind: str) -> str:
    """The one end of an interval, and what is left of it where the law leaves something out that acts."""
    told = f"{word} {format_quantity(end, kind)}"
    if not entry.left_out:
        return told
    left = f"{word} {format_quantity(wide, kind)}" if math.isfinite(wide) else "anything"
    return f"{told} from the noise, with {_listed(entry)} unknown {left}"


def _listed(entry: Estimate) -> str:
    *first, last = entry.left_out
    return f"{', '.join(first)} and {last}" if first else last


def _bonds(result: Fit) -> list[str]:
    """What each bond of an unknown face gives: ``"Bonded: layer modulus 1 kPa; free to slip: ...``."""
    sentences = []
    for told in result.bonds:
        sides = [
            f"{side}: "
            + ", ".join(
                f"{label(name)} {quantity_with_interval(known.value, known.low, known.high, kind_of(name))}"
                for name, known in intervals.items()
                if is_of_the_sample(name)
            )
            for side, intervals in (("bonded", told.bonded), ("free to slip", told.slipping))
        ]
        where = "" if told.face == "layer" else f"{label(told.face)}: "
        sentences.append(start(f"{where}{'; '.join(sides)}."))
    return sentences


def _substrate_sentence(result: Fit) -> str:
    """How much the substrate does at the deepest point of every curve."""
    if all(scene.substrate is None for scene in result.scenes):
        return "The sample is taken as a half-space: no substrate was declared."
    ratios, deepest, contacts = [], [], []
    for test in distinct_scenes(result.scenes, result.curves):
        if not test.deepest > 0.0:
            continue
        at = np.array([test.deepest])
        law = test.scene.contact_law(test.deepest, solver=result.solver)
        bare = test.scene.contact_law(test.deepest, solver="halfspace")
        ratios.append(float(law.force(at)[0] / bare.force(at)[0]))
        contacts.append(float(law.contact_radius(at)[0]) / test.scene.layer.thickness)
        deepest.append(test.deepest)
    if not ratios:
        return ""
    which = "the deepest point" if len(result.curves) == 1 else "the deepest points of the curves"
    if all(abs(ratio - 1.0) < _NOTICEABLE for ratio in ratios):
        return f"The substrate changes the force at {which} by less than 1 %."
    length, mm = human_unit(max(deepest), "length")
    wrong = {"large" if ratio > 1.0 else "small" for ratio in ratios if abs(ratio - 1.0) >= _NOTICEABLE}
    return (
        f"At {which} ({_range(np.divide(deepest, mm), 4)} {length} into the sample, contact radius "
        f"{_range(contacts, 2)} of the thickness) the force is {_range(ratios, 3)} times that on a "
        f"half-space of the same modulus: a half-space formula would make the modulus too "
        f"{' or too '.join(sorted(wrong))}."
    )


def _range(values: ArrayLike, digits: int) -> str:
    """Return ``"0.12"``, or ``"0.12 to 0.2"`` where the smallest and the largest differ in writing."""
    low, high = (f"{end:.{digits}g}" for end in (np.min(values), np.max(values)))
    return low if low == high else f"{low} to {high}"


def _width_sentence(result: Fit) -> str:
    if not is_averaged(result):
        return ""
    errors = [error.words for error in known_errors(result.problem.base_scenes)]
    allowed = f" They allow for {' and for '.join(errors)}." if errors else ""
    return (
        "No noise was stated: the intervals are averaged over white and correlated noise, a law that drifts "
        f"and a force that sets in at contact, each by its probability.{allowed} The fitted curve, its "
        f"residuals and the test are drawn at the least-squares optimum for white noise{_at_optimum(result)}."
    )


def _at_optimum(result: Fit) -> str:
    """The first number of the sample there: ``": layer modulus 98.6 kPa"``."""
    for entry in result.problem.coordinates:
        if is_of_the_sample(entry.name):
            value = format_quantity(result.values[entry.name], kind_of(entry.path))
            return f": {label(entry.name)} {value}"
    return ""


def _narrowness_sentence(result: Fit) -> str:
    if is_averaged(result):
        return ""
    worst = max((d.too_narrow_by for d in result.diagnostics if d.correlated), default=0.0)
    if not worst:
        return ""
    return (
        f"**The intervals above are too narrow, by a factor of about {worst:.1f}**: the residuals hang "
        "together, so the points tell less than their number."
    )


def _reservation_sentence(result: Fit) -> str:
    notes = sum(len(curve.metadata.get("notes", ())) for curve in result.curves)
    count = notes + len(doubts_of_curves(result)) + len(standing(result))
    if not count:
        return ""
    return f"There {'is one reservation' if count == 1 else f'are {count} reservations'}, listed below."
