"""Results in sentences: what was found, how sure it is, and what the test does not tell."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from underlay._text import one_line
from underlay.report.intervals import quantity_with_interval
from underlay.report.labels import is_of_the_sample, label, labelled, start
from underlay.report.screen import answer_text
from underlay.report.spoken import markdown_text
from underlay.scene.parameters import kind_of

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.sampling.posterior import Posterior

__all__ = [
    "headline",
    "known_together",
    "posterior_summary",
    "strong_pairs",
    "verdict_sentence",
]

#: Above this, two parameters are not known one by one, only together.
STRONG = 0.9
#: Confidence of the intervals in a sentence.
_LEVEL = 0.95
# A standard error of the logarithm above which a parameter is badly known by itself.
_BADLY = 0.05


def headline(result: Fit) -> str:
    """Return the result in one sentence per parameter of the sample.

    Examples
    --------
    ``"Layer modulus 0.617 ± 0.037 MPa (95 %; stat 0.009, syst 0.036)."``
    """
    return " ".join(_sentences(result))


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
