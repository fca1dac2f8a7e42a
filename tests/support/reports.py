"""What the tests of reports share: samples, a small posterior, and how to look into pages and notebooks."""

import functools
import html
import json
import re
import warnings
from pathlib import Path

import numpy as np

import underlay as ul

SAMPLES = Path(__file__).resolve().parents[2] / "data_samples"


@functools.cache
def small_posterior():
    """(problem, posterior) of a curve on a half-space; short, and perhaps not converged."""
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5)))
    curve = ul.synthesize(scene, np.linspace(-1e-5, 1e-4, 60), noise=ul.Noise(force=1e-3), rng=0)
    free = {"layer.E": ul.LogUniform(1e4, 1e8), "instrument.contact_depth": ul.Uniform(-1e-5, 1e-5)}
    problem = ul.Problem(scene, curve, free, noise=ul.Noise(force=1e-3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ul.UnderlayWarning)
        return problem, ul.sample(problem, walkers=16, max_steps=300, rng=0)


@functools.cache
def sample_fit(name):
    """The fit of a sample whose curve and scene have one name."""
    return ul.fit(ul.load_problem(SAMPLES / f"{name}.csv", SAMPLES / f"{name}.toml"))


def page_text(path):
    """Words of a page without its markup."""
    return text_in(path.read_text(encoding="utf-8"))


def text_in(page):
    """Words of HTML, with single spaces between them."""
    text = re.sub(r"<style>.*?</style>|<[^>]*>", " ", page, flags=re.DOTALL)
    return " ".join(html.unescape(text).split())


def cells_of(path):
    """Cells of a notebook file."""
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def write_result(path):
    """What `underlay fit` writes of a small curve."""
    scene = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1.3e-3), ul.RIGID)
    curve = ul.synthesize(scene, np.linspace(-1e-5, 8e-5, 80), ul.Noise(force=1e-4), rng=0)
    ul.fit(ul.Problem(scene, curve, {"layer.E": (1e4, 1e8)})).to_json(path)


@functools.cache
def joint_fit():
    """A fit of three curves, the first and the last of one scene, the second with a larger ball."""
    layer = ul.Layer(ul.Isotropic(1e6, 0.45), 1.3e-3)
    tests = []
    for number, (radius, depth) in enumerate(((5e-4, 8e-5), (2e-3, 1e-4), (5e-4, 1.2e-4))):
        scene = ul.Scene(ul.Sphere(radius), layer, ul.RIGID, ul.Instrument(contact_depth=number * 1e-6))
        curve = ul.synthesize(scene, np.linspace(-1e-5, depth, 80), noise=ul.Noise(force=1e-4), rng=number)
        tests.append((scene, curve.with_metadata(name=f"site-{number + 1}")))
    free = {
        "layer.E": (1e4, 1e8),
        "layer.thickness": (1e-4, 1e-2),
        "instrument.contact_depth": (-1e-5, 1e-5),
    }
    return ul.fit(ul.Problem.joint(tests, free, shared=["layer.E", "layer.thickness"]))
