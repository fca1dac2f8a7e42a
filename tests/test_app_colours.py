"""Colours of the page: readable, and apart for eyes that lack one kind of cones."""

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import underlay.app as app_package
from underlay.app.pages import fitting
from underlay.app.pages.routes import COLOURS
from underlay.report.plots.style import DATA, FIT, REFERENCE

CSS = (Path(app_package.__file__).parent / "pages" / "page.css").read_text(encoding="utf-8")
WHITE = "#ffffff"
# What linear RGB looks like without one kind of cones (Machado, Oliveira and Fernandes 2009, severity 1).
EYES = {
    "all cones": np.eye(3),
    "no long": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "no middle": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "no short": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
# WCAG 2.1: of text, and of what must be seen to understand a picture.
TEXT, SHAPE = 4.5, 3.0
# Differences in CIE L*a*b* that nobody overlooks: ten times the smallest that is seen.
APART = 23.0


def style_of(selector, prop):
    """Value of a property in the rule of exactly this selector."""
    rules = re.findall(
        rf"(?:^|[,}}])\s*{re.escape(selector)}(?:,[^{{]*)?\s*\{{([^}}]*)\}}", CSS, re.MULTILINE
    )
    found = [value for rule in rules for value in re.findall(rf"(?<![\w-]){prop}:\s*([^;]+);", rule)]
    (colour,) = re.findall(r"#[0-9a-f]{3,6}", found[-1])
    return colour if len(colour) == 7 else "#" + "".join(2 * digit for digit in colour[1:])


def linear(colour):
    values = np.array([int(colour[start : start + 2], 16) for start in (1, 3, 5)]) / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def contrast(one, other):
    light, dark = sorted((linear(c) @ [0.2126, 0.7152, 0.0722] for c in (one, other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def lab(rgb):
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ rgb
    t = np.clip(xyz / [0.9505, 1.0, 1.089], 0.0, 1.0)
    f = np.where(t > 0.008856, np.cbrt(t), 7.787 * t + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


def distance(one, other, eye):
    a, b = (lab(np.clip(np.asarray(EYES[eye]) @ linear(c), 0.0, 1.0)) for c in (one, other))
    return float(np.linalg.norm(a - b))


def test_the_measures_know_black_from_white_and_red_from_green():
    assert contrast("#000000", WHITE) == pytest.approx(21.0)
    assert contrast("#777777", WHITE) == pytest.approx(4.48, abs=0.01)
    assert distance("#000000", WHITE, "all cones") == pytest.approx(100.0, abs=0.1)
    # A red and a green of one lightness: apart for most, not without middle cones.
    assert distance("#b05050", "#688030", "all cones") > 2.0 * distance("#b05050", "#688030", "no middle")


@pytest.mark.parametrize(
    ("words", "ground"),
    [
        *((style_of(rule, "color"), WHITE) for rule in ("body", ".quiet", ".name", ".steps .q-tab--active")),
        (style_of(".files .q-item--active", "color"), style_of(".files .q-item--active", "background")),
        (style_of(".card-picture text", "fill"), WHITE),
        (WHITE, COLOURS["primary"]),
        (WHITE, COLOURS["negative"]),
        (COLOURS["primary"], WHITE),
    ],
)
def test_words_are_readable(words, ground):
    assert contrast(words, ground) >= TEXT


HANDLES = (fitting.GREEN, fitting.GREY)
CARDS = tuple(
    style_of(*rule) for rule in ((".card.check", "border-left-color"), (".card.refused", "border-left"))
)
GOOD_CARD = style_of(".card", "border-left")


@pytest.mark.parametrize("shape", [*HANDLES, *CARDS, GOOD_CARD, FIT, REFERENCE, DATA, COLOURS["accent"]])
def test_shapes_are_seen(shape):
    assert contrast(shape, WHITE) >= SHAPE


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize(
    # Handles are upright lines with a grip, so they are never taken for a curve.
    "colours",
    [HANDLES, (GOOD_CARD, *CARDS), (FIT, REFERENCE, DATA)],
    ids=["handles", "cards", "curves"],
)
def test_colours_that_say_different_things_are_apart(colours, eye):
    for one, other in combinations(colours, 2):
        assert distance(one, other, eye) >= APART, (one, other)
