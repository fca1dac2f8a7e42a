"""What each effect of a scene costs, and what choosing a law costs; nothing here asserts seconds.

Run with `python -m pytest tests/benchmarks --benchmark-enable` and compare the medians of one run.
"""

from dataclasses import replace

import numpy as np
import pytest

import underlay as ul
from support.laws import exact_law

GEL = ul.Isotropic(1e4, 0.45)
FIBROUS = ul.TransverselyIsotropic(E=2e4, E_axial=1e4, nu=0.3, nu_axial=0.2, G_axial=4e3)
PLAIN = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(GEL))
SCENES = {
    "none": PLAIN,
    "finite thickness": replace(PLAIN, layer=ul.Layer(GEL, 1e-3), substrate=ul.RIGID),
    "substrate compliance": replace(PLAIN, layer=ul.Layer(GEL, 1e-3), substrate=ul.Isotropic(1e5, 0.3)),
    "anisotropy": replace(PLAIN, layer=ul.Layer(FIBROUS)),
    "true sphere": replace(PLAIN, indenter=ul.Sphere(1e-3)),
    "instrument compliance": replace(PLAIN, instrument=ul.Instrument(compliance=1e-2)),
    "baseline": replace(PLAIN, instrument=ul.Instrument(baseline=1e-5, baseline_slope=0.1)),
}
LAYER = ul.Layer(GEL, 1e-3)
#: Depths (m) of a paraboloid on a rigid base whose law at 1e-6 is another each time.
CHOICES = {"half-space": 1e-16, "exact": 1e-4}


@pytest.mark.parametrize("effect", SCENES)
def test_curve_with_one_effect(benchmark, effect):
    depth = np.linspace(5e-8, 5e-5, 1000)
    benchmark(SCENES[effect].force, depth, solver=ul.Auto(1e-6))


@pytest.mark.parametrize("choice", CHOICES)
def test_choosing_and_building_a_law(benchmark, choice):
    benchmark(ul.Auto(1e-6).build, ul.Contact.of(ul.Paraboloid(1e-3), LAYER, ul.RIGID), CHOICES[choice])


def test_building_the_exact_law_unasked(benchmark):
    benchmark(exact_law, ul.Paraboloid(1e-3), LAYER, ul.RIGID, max_depth=CHOICES["exact"], rtol=1e-6)
