"""What is declared of a number is true of the force, and its path leads to it and back."""

import subprocess
import sys
from dataclasses import dataclass, field, fields, replace

import numpy as np
import pytest

import underlay as ul
from underlay.quantities import (
    Part,
    curve_of,
    declared,
    field_quantities,
    kind_of,
    numbers_of,
    path_of,
    replace_values,
)
from underlay.report.labels import label, labelled, symbol
from underlay.scene.instrument import Chain
from underlay.units import KINDS

SCENE = ul.Scene(
    ul.Sphere(1e-3),
    ul.Layer(ul.TransverselyIsotropic(E=6e5, E_axial=4e5, nu=0.3, nu_axial=0.2, G_axial=2e5), 1e-3),
    ul.Isotropic(5e6, 0.3),
    ul.Instrument(contact_depth=2e-6, baseline=1e-4, baseline_slope=3.0, compliance=1e-3),
)
DEPTH = np.linspace(-2e-5, 6e-5, 42)  # no point at the contact, where the force has no second derivative


def parts():
    """Every dataclass of the package whose numbers stand in a scene or its noise."""
    waiting = Part.__subclasses__()
    while waiting:
        kind = waiting.pop()
        waiting += kind.__subclasses__()
        if kind.__module__.startswith("underlay.") and hasattr(kind, "__dataclass_fields__"):
            yield kind


@pytest.mark.parametrize("kind", sorted(parts(), key=lambda kind: kind.__name__))
def test_every_number_of_the_house_is_declared(kind):
    known = field_quantities(kind)
    for entry in fields(kind):
        words = entry.type in ("str", "Relaxation | None", "Stiffening | None", "Indenter", "Layer", "Kept")
        if words or entry.metadata.keys() & {"inlined", "no number", "words"}:
            continue
        assert "quantity" in entry.metadata, entry.name
        assert known[entry.name].kind in KINDS
        assert known[entry.name].label


def test_the_force_is_linear_in_what_says_so_and_in_nothing_else():
    for path, known in SCENE.quantities.items():
        value = SCENE.parameters[path]
        step = 0.1 * value
        down, here, up = (
            SCENE.with_values({path: value + sign * step}).force(DEPTH, solver="exact") for sign in (-1, 0, 1)
        )
        bend = np.abs(up + down - 2.0 * here).max()
        # Rounding leaves 1e-15 of the force; what is bent at all is bent by far more over a tenth of its value.
        assert (bend < 1e-9 * np.abs(here).max()) == known.linear, path


def test_scales_of_force_and_length_scale_the_contact():
    # Dimensions: P = E h^2 f(w/h, R/h, ratios); what is declared a scale is all there is of either.
    scene = replace(SCENE, instrument=ul.Instrument())
    plain = scene.force(DEPTH, solver="exact")
    for what, factor, depth in (("force", 2.0, DEPTH), ("length", 4.0, 2.0 * DEPTH)):
        scaled = scene.with_values(
            {p: 2.0 * scene.parameters[p] for p, q in scene.quantities.items() if q.scales == what}
        )
        assert scaled.force(depth, solver="exact") == pytest.approx(factor * plain, rel=1e-5, abs=1e-14)


@dataclass(frozen=True)
class Relaxation(Part):
    parts = ("mould",)
    times: tuple[float, ...] = field(
        metadata=ul.quantity("time", "relaxation time of the {part}", bounds=(0.0, np.inf), many=True)
    )


@dataclass(frozen=True)
class Sheet(Part):
    parts = ("mould",)
    material: ul.Isotropic = field(metadata={"inlined": True})
    width: float = 1e-3
    relaxation: Relaxation | None = None


@dataclass(frozen=True)
class Mould:
    mould: Sheet
    sheets: tuple[Sheet, ...] = ()


def test_paths_lead_through_parts_and_indices_and_back():
    soft = Sheet(ul.Isotropic(1e3, 0.4), 2e-3, Relaxation((0.1, 2.0)))
    whole = Mould(soft, (Sheet(ul.Isotropic(1e4, 0.3)), soft))
    numbers = numbers_of(whole)
    assert numbers["mould.E"].value == 1e3
    assert numbers["mould.relaxation.times[1]"].value == 2.0
    assert numbers["sheets[0].E"].value == 1e4
    assert numbers["sheets[1].relaxation.times[0]"].quantity.kind == "time"
    assert len(numbers) == 5 + 3 + 5
    changed = replace_values(whole, {"sheets[1].relaxation.times[0]": 0.3, "sheets[0].width": 5e-3})
    assert changed.sheets[1].relaxation.times == (0.3, 2.0)
    assert changed.sheets[0].width == 5e-3
    assert changed.mould is whole.mould
    everything = {path: number.value for path, number in numbers.items()}
    assert replace_values(changed, everything) == whole


@pytest.mark.parametrize(
    ("name", "path", "curve"),
    [
        ("layer.E", "layer.E", None),
        ("layer.E[1]", "layer.E", 1),
        ("substrate.layers[0].E", "substrate.layers[0].E", None),
        ("substrate.layers[0].E[2]", "substrate.layers[0].E", 2),
        ("mould.relaxation.times[1]", "mould.relaxation.times[1]", None),
        ("mould.relaxation.times[1][0]", "mould.relaxation.times[1]", 0),
    ],
)
def test_a_name_is_a_path_and_maybe_a_curve(name, path, curve):
    assert (path_of(name), curve_of(name)) == (path, curve)
    assert kind_of(name) == kind_of(path)


def test_names_in_sentences_and_formulas():
    assert label("layer.E[1]") == "layer modulus (curve 2)"
    assert label("substrate.layers[0].E") == "layer 2 modulus"
    assert label("mould.relaxation.times[1]") == "relaxation time of the mould (term 2)"
    assert label("layer.nu.stderr") == "standard error of the Poisson's ratio of the layer"
    assert symbol("substrate.nu") == r"\nu_2"
    assert symbol("layer.E[1]") == "E^{(2)}"
    assert symbol("layer.relaxation.fractions[1]") == "f_{2}"
    assert symbol("layer.relaxation.times[0][1]") == r"\tau_{1}^{(2)}"
    assert declared("indenter.tip_radius").is_scale  # by the last word of its name


def test_the_links_say_their_derivatives():
    values = SCENE.parameters
    paths = [path for path in values if path.startswith("instrument.")]
    law = SCENE.contact_law(1e-4, solver="exact")

    def force(changed):
        chain = Chain.of(values | changed)
        return chain.reading(law.force(chain.tip_depth(law, DEPTH)), DEPTH)

    chain = Chain.of(values)
    w = chain.tip_depth(law, DEPTH)
    P, S = law.force_and_stiffness(w)
    said = chain.offset_slopes(DEPTH) | {
        "instrument.contact_depth": chain.at_fixed_travel(-S, S),
        "instrument.compliance": chain.frame.slope(P, S),
    }
    assert sorted(said) == sorted(paths)
    for path in paths:
        step = 1e-4 * values[path]
        slope = (force({path: values[path] + step}) - force({path: values[path] - step})) / (2.0 * step)
        assert slope == pytest.approx(said[path], rel=1e-4, abs=1e-6 * np.abs(slope).max()), path


def test_links_of_many_sets_are_those_of_each():
    sets = {
        "instrument.contact_depth": np.array([[0.0], [1e-6], [-2e-6]]),
        "instrument.baseline": np.array([[0.0], [1e-4], [2e-4]]),
        "instrument.baseline_slope": 2.0,
        "instrument.compliance": 0.0,
    }
    many = Chain.of(sets)
    for row in range(3):
        alone = Chain.of({p: float(v[row, 0]) if isinstance(v, np.ndarray) else v for p, v in sets.items()})
        assert np.array_equal(many.travel(DEPTH)[row], alone.travel(DEPTH))
        assert np.array_equal(many.reading(DEPTH, DEPTH)[row], alone.reading(DEPTH, DEPTH))


class Forgetful(ul.History):
    """Remembers nothing."""

    def force(self, elastic, depth, time):
        del time
        return elastic(depth)


def test_a_history_is_refused_where_it_is_not_simulated():
    with pytest.raises(ul.UnderlayError, match="take it out of the depth first"):
        replace(SCENE, history=dataclass(frozen=True)(Forgetful)())


@pytest.mark.parametrize("module", ["underlay.scene.parameters", "underlay.report.labels"])
def test_what_a_path_is_does_not_hang_on_what_was_imported(module):
    # A map is drawn by a process that has read a table and nothing else.
    paths = {
        "layer.E": "pressure",
        "layer.relaxation.times[0]": "time",
        "substrate.G_axial": "pressure",
        "indenter.radius": "length",
        "indenter.half_angle": "angle",
        "adhesion.work": "surface energy",
        "instrument.compliance": "compliance",
        "noise.force": "force",
    }
    code = f"import {module}\nfrom underlay.quantities import declared\n" + "\n".join(
        f"assert declared({path!r}).kind == {kind!r} and declared({path!r}).label, {path!r}"
        for path, kind in paths.items()
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_sentence_calls_parameters_by_their_words():
    said = "layer.E of layer.E_axial and layer.E[1] is on its bound: free layer.thickness. Not layer.E."
    assert labelled(said) == (
        "layer modulus of axial modulus of the layer and layer modulus (curve 2) is on its bound: free layer "
        "thickness. Not layer modulus."
    )
    assert labelled("layer.toml and player.E stay") == "layer.toml and player.E stay"
