"""Our law inside nanite: their fit with our model file gives what ours gives."""

from pathlib import Path

import numpy as np
import pytest

import underlay as ul
from support.nanite_curves import indentation

# Of a library of theirs, at versions of today's lower bounds.
pytestmark = pytest.mark.filterwarnings("ignore:Using UFloat objects with std_dev==0:UserWarning")

MODEL = Path(__file__).resolve().parents[1] / "data_samples" / "nanite" / "model_underlay_layer.py"
SCENE = ul.Scene(
    ul.Sphere(5e-6),
    ul.Layer(ul.Isotropic(3e3, 0.45), 8e-6),
    ul.RIGID,
    instrument=ul.Instrument(contact_depth=2e-7, baseline=3e-11),
)
DEPTH = np.linspace(-1e-6, 2e-6, 400)


@pytest.fixture(scope="module")
def nanite():
    """Return nanite with our model registered, as its users do."""
    package = pytest.importorskip("nanite", reason="nanite is not installed: pip install nanite")
    from nanite import model  # noqa: PLC0415  where it is installed

    model.load_model_from_file(MODEL, register=True)
    yield package
    model.deregister_model(model.models_available["underlay_layer"])


def their_fit(nanite, curve, **known):
    test = indentation(nanite, curve.depth, curve.force)
    initial = test.get_initial_fit_parameters(model_key="underlay_layer")
    for name, value in known.items():
        initial[name].value = value
    test.fit_model(
        model_key="underlay_layer",
        params_initial=initial,
        preprocessing=[],
        weight_cp=0,
        method_kws={"ftol": 1e-14, "xtol": 1e-14},
    )
    assert test.fit_properties["success"]
    return {name: found.value for name, found in test.fit_properties["params_fitted"].items()}


@pytest.mark.parametrize("seed", [1, 2])
def test_their_fit_with_our_model_is_our_fit(nanite, seed):
    curve = ul.synthesize(SCENE, DEPTH, ul.Noise(force=1e-10), rng=seed)
    theirs = their_fit(nanite, curve, R=5e-6, nu=0.45, thickness=8e-6)
    free = {"layer.E": (1e1, 1e6), "instrument.contact_depth": (-1e-6, 1e-6), "instrument.baseline": None}
    # Both minimise the plain sum of squares.
    ours = ul.fit(ul.Problem(SCENE, curve, free, ul.Noise(force=1e-10), solver=ul.Exact(rtol=1e-9))).values
    assert theirs["E"] == pytest.approx(ours["layer.E"], rel=1e-6)
    deep = DEPTH[-1]
    assert -theirs["contact_point"] == pytest.approx(ours["instrument.contact_depth"], abs=1e-6 * deep)
    top = curve.force.max()
    assert theirs["baseline"] == pytest.approx(ours["instrument.baseline"], abs=1e-6 * top)
    # The truth is there too, and a half-space would not have found it.
    assert theirs["E"] == pytest.approx(3e3, rel=0.02)


def test_the_model_is_the_law(nanite):
    models = nanite.model.models_available
    entry = models["underlay_layer"]
    law = ul.contact_law(SCENE.indenter, SCENE.layer, ul.RIGID, max_depth=2e-6, solver=ul.Exact(rtol=1e-9))
    depth = np.linspace(0.0, 2e-6, 50)
    told = entry.module.model_func(-depth, 3e3, 5e-6, 0.45, 8e-6)
    assert told == pytest.approx(law.force(depth), rel=1e-8, abs=1e-16)
    # Far above the base it is Hertz's model, which nanite has.
    hertz = models["hertz_para"].module.model_func(-depth / 1e3, 3e3, 5e-6, 0.45)
    assert entry.module.model_func(-depth / 1e3, 3e3, 5e-6, 0.45, 1.0) == pytest.approx(hertz, rel=1e-3)


def test_a_guess_deeper_than_the_tip_goes_on_by_the_tangent(nanite):
    model = nanite.model.models_available["underlay_layer"].module.model_func
    depth = np.linspace(0.0, 2e-5, 200)  # of a sphere of 5 um
    force = model(-depth, 3e3, 5e-6, 0.45, 8e-6)
    rise = np.diff(force)
    assert (rise > 0.0).all()
    assert rise[-1] == pytest.approx(rise[-2], rel=1e-9)
