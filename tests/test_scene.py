"""Scenes: declaring them, naming their numbers, and reading a force through an instrument."""

import dataclasses

import numpy as np
import pytest

import underlay as ul
from underlay.quantities import kind_of
from underlay.scene.instrument import Baseline, ContactDepth, Frame

CARTILAGE = ul.Scene(
    ul.Sphere(1e-3),
    ul.Layer(ul.Isotropic(0.6e6, 0.45), 1.5e-3),
    ul.RIGID,
    ul.Instrument(contact_depth=2e-6, baseline=1e-4, baseline_slope=3.0, compliance=1e-6),
)
DEPTH = np.linspace(-2e-5, 6e-5, 41)


def test_every_number_has_a_path():
    assert CARTILAGE.parameters == {
        "indenter.radius": 1e-3,
        "layer.E": 0.6e6,
        "layer.nu": 0.45,
        "layer.thickness": 1.5e-3,
        "instrument.contact_depth": 2e-6,
        "instrument.baseline": 1e-4,
        "instrument.baseline_slope": 3.0,
        "instrument.compliance": 1e-6,
    }


def test_values_are_replaced_in_a_new_scene():
    changed = {"layer.E": 1e6, "layer.thickness": 1e-3, "indenter.radius": 2e-3}
    other = CARTILAGE.with_values(changed)
    assert CARTILAGE.layer.material.E == 0.6e6
    assert other.parameters == CARTILAGE.parameters | changed


@pytest.mark.parametrize(
    ("path", "nearest"),
    [("layer.e", "layer.E"), ("layer.thicknes", "layer.thickness"), ("substrate.E", "layer.E")],
)
def test_unknown_path_names_the_nearest(path, nearest):
    with pytest.raises(ul.ParameterError, match=f"did you mean '{nearest}'"):
        CARTILAGE.with_values({path: 1.0})


def test_kinds():
    assert kind_of("substrate.E_axial") == "pressure"
    assert kind_of("indenter.half_angle") == "angle"
    assert kind_of("indenter.tip_radius") == "length"
    assert kind_of("indenter.roundness") == "dimensionless"


def test_a_scene_cannot_be_changed():
    with pytest.raises(dataclasses.FrozenInstanceError):
        CARTILAGE.layer = None


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ul.Scene("sphere", CARTILAGE.layer, ul.RIGID), "must be an Indenter"),
        (lambda: ul.Scene(CARTILAGE.indenter, 1e-3, ul.RIGID), "Layer"),
        (lambda: ul.Scene(CARTILAGE.indenter, CARTILAGE.layer), "needs a substrate"),
        (lambda: ul.Scene(CARTILAGE.indenter, CARTILAGE.layer, "bone"), "substrate must be"),
        (lambda: ul.Scene(CARTILAGE.indenter, CARTILAGE.layer, ul.RIGID, 0.0), "must be an Instrument"),
        (lambda: ul.Layer(ul.RIGID, 1e-3), "made of"),
        (lambda: ul.Layer(ul.Isotropic(1e6, 0.3), -1e-3), "thickness must be positive"),
        (lambda: ul.Layer(ul.Isotropic(1e6, 0.3), np.nan), "thickness must be positive"),
        (lambda: ul.Isotropic(-1e6, 0.3), "must be positive"),
        (lambda: ul.Isotropic(1e6, 0.51), r"in \(-1, 0.5\]"),
        (lambda: ul.Isotropic(1e6, -1.0), r"in \(-1, 0.5\]"),
        (lambda: ul.Instrument(compliance=-1.0), "zero or positive"),
        (lambda: ul.Instrument(baseline=np.inf), "finite"),
        (lambda: ul.Auto(rtol=0.0), "rtol must be between"),
        (lambda: CARTILAGE.force(DEPTH, solver="magic"), "no solver is called"),
    ],
)
def test_bad_scenes(make, message):
    with pytest.raises(ul.InputError, match=message):
        make()


def test_instrument_adds_what_it_says():
    ideal = dataclasses.replace(CARTILAGE, instrument=ul.Instrument())
    level = dataclasses.replace(CARTILAGE, instrument=ul.Instrument(contact_depth=2e-6, baseline=1e-4))
    shifted = ideal.force(DEPTH - 2e-6)
    assert level.force(DEPTH) == pytest.approx(shifted + 1e-4, rel=1e-12)


def test_compliance_shares_the_travel():
    # Whatever the law, tip depth + compliance * force = travel since contact, to the last digits.
    instrument = CARTILAGE.instrument
    law = CARTILAGE.contact_law(1e-4)
    w = instrument.chain.tip_depth(law, DEPTH)
    travel = w + instrument.compliance * law.force(w)
    assert travel == pytest.approx(DEPTH - instrument.contact_depth, rel=1e-13, abs=1e-20)


def test_far_too_soft_a_frame_still_converges():
    soft = ul.Instrument(compliance=1e3)
    law = CARTILAGE.contact_law(1e-4)
    w = soft.chain.tip_depth(law, np.array([1e-4, 1e-6]))
    assert w + 1e3 * law.force(w) == pytest.approx([1e-4, 1e-6], rel=1e-12)


def test_an_ideal_instrument_runs_no_instrument_code(monkeypatch):
    calls = []
    for link, step in ((Frame, "tip_depth"), (ContactDepth, "travel"), (Baseline, "reading")):
        monkeypatch.setattr(link, step, lambda *_: calls.append("a link"))
    ideal = dataclasses.replace(CARTILAGE, instrument=ul.Instrument())
    law = ideal.contact_law(1e-4)
    assert ideal.instrument.chain.tip_depth(law, DEPTH) is DEPTH
    force = law.force(DEPTH)
    assert ideal.instrument.chain.reading(force, DEPTH) is force
    assert not calls


def test_a_half_space_computes_no_kernel(monkeypatch):
    def never(*_args, **_options):
        raise AssertionError("the kernel was computed")

    monkeypatch.setattr("underlay.mechanics.kernel.bodies.isotropic_formula", never)
    bare = ul.Scene(ul.Sphere(1e-3), ul.Layer(ul.Isotropic(0.6e6, 0.45)))
    same = ul.Scene(ul.Sphere(1e-3), ul.Layer(bare.layer.material, 1e-3), bare.layer.material)
    assert same.force(DEPTH) == pytest.approx(bare.force(DEPTH), rel=0, abs=0)
