"""Results in sentences: what was found, how sure it is, and what the test does not tell."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from underlay._arrays import ArrayLike
from underlay._text import one_line
from underlay.report.intervals import doubts_of_curves, quantity_with_interval
from underlay.report.labels import is_of_the_sample, label, labelled, start
from underlay.report.limits import advice, distinct_scenes, rivals
from underlay.report.screen import answer_text
from underlay.report.spoken import markdown_text
from underlay.scene.parameters import kind_of
from underlay.units import human_unit, printed

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.sampling.posterior import Posterior

__all__ = [
    "headline",
    "known_together",
    "noted",
    "posterior_summary",
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
    ``"Layer modulus 0.617 ± 0.037 MPa (95 %; stat 0.009, syst 0.036)."``
    """
    return " ".join(_sentences(result))


def summary(result: Fit) -> str:
    """Return the result as Markdown: numbers, verdict, rivals, what holds together, substrate, doubts."""
    paragraphs = [" ".join(f"**{text}**" for text in _sentences(result)), f"**{verdict_sentence(result)}**"]
    paragraphs += [*advice(result), *rivals(result)]
    paragraphs += [
        f"{start(label(first))} and {label(second)} are known only together (correlation {value:+.3f}): "
        f"if one is wrong, so is the other."
        for first, second, value in known_together(result)
        if is_of_the_sample(first) and is_of_the_sample(second)
    ]
    paragraphs += [_substrate_sentence(result), _reservation_sentence(result)]
    return printed("\n\n".join(text for text in paragraphs if text))


def _sentences(result: Fit) -> list[str]:
    """One sentence per number of the sample: the E of a Prony series is the modulus at once."""
    names = [name for name in (*result.names, *result.derived) if is_of_the_sample(name)]
    names = [
        name
        for name in names
        if "instantaneous_modulus" not in name or name.replace("instantaneous_modulus", "E") not in names
    ]
    return [f"{start(label(name))} {answer_text(result.answer(name))}." for name in names]


def verdict_sentence(result: Fit) -> str:
    """Return the verdict with its reasons, parameters by their words: ``"Verdict: good."``."""
    verdict = result.verdict
    parts = [
        str(verdict),
        verdict.cause and f"likely cause: {verdict.cause}",
        verdict.next and f"next: {verdict.next}",
    ]
    told = "; ".join(part for part in parts if part)
    return f"Verdict: {markdown_text(labelled(one_line(told), result.names))}."


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


def _reservation_sentence(result: Fit) -> str:
    notes = sum(len(curve.metadata.get("notes", ())) for curve in result.curves)
    count = notes + len(doubts_of_curves(result)) + len(result.warnings)
    if not count:
        return ""
    return f"There {'is one reservation' if count == 1 else f'are {count} reservations'}, listed below."
