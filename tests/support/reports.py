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


def page_text(path):
    """Words of a page without its markup."""
    text = re.sub(r"<style>.*?</style>|<[^>]*>", " ", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return " ".join(html.unescape(text).split())


def cells_of(path):
    """Cells of a notebook file."""
    return json.loads(path.read_text(encoding="utf-8"))["cells"]
