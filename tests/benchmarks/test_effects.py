"""What each effect of a scene costs, and what choosing a law costs; nothing here asserts seconds.

Run with `python -m pytest tests/benchmarks --benchmark-enable` and compare the medians of one run.
"""

from dataclasses import replace

import numpy as np
import pytest

from support.laws import exact_law
from underlay.mechanics.body import RIGID, Layer
from underlay.mechanics.contact import Contact
from underlay.mechanics.indenters import Paraboloid, Sphere
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.mechanics.solvers import Auto
from underlay.scene.instrument import Instrument
from underlay.scene.scene import Scene

GEL = Isotropic(1e4, 0.45)
FIBROUS = TransverselyIsotropic(E=2e4, E_axial=1e4, nu=0.3, nu_axial=0.2, G_axial=4e3)
PLAIN = Scene(Paraboloid(1e-3), Layer(GEL))
SCENES = {
    "none": PLAIN,
    "finite thickness": replace(PLAIN, layer=Layer(GEL, 1e-3), substrate=RIGID),
    "substrate compliance": replace(PLAIN, layer=Layer(GEL, 1e-3), substrate=Isotropic(1e5, 0.3)),
    "anisotropy": replace(PLAIN, layer=Layer(FIBROUS)),
    "true sphere": replace(PLAIN, indenter=Sphere(1e-3)),
    "instrument compliance": replace(PLAIN, instrument=Instrument(compliance=1e-2)),
    "baseline": replace(PLAIN, instrument=Instrument(baseline=1e-5, baseline_slope=0.1)),
}
LAYER = Layer(GEL, 1e-3)
#: Depths (m) of a paraboloid on a rigid base whose law at 1e-6 is another each time.
CHOICES = {"half-space": 1e-16, "exact": 1e-4}


@pytest.mark.parametrize("effect", SCENES)
def test_curve_with_one_effect(benchmark, effect):
    depth = np.linspace(5e-8, 5e-5, 1000)
    benchmark(SCENES[effect].force, depth, solver=Auto(1e-6))


@pytest.mark.parametrize("choice", CHOICES)
def test_choosing_and_building_a_law(benchmark, choice):
    benchmark(Auto(1e-6).build, Contact.of(Paraboloid(1e-3), LAYER, RIGID), CHOICES[choice])


def test_building_the_exact_law_unasked(benchmark):
    benchmark(exact_law, Paraboloid(1e-3), LAYER, RIGID, max_depth=CHOICES["exact"], rtol=1e-6)
