"""The form of a scene: what it takes and refuses, and that every key of a scene file has a place on the page."""

from dataclasses import replace

import pytest

import underlay as ul
from underlay.app import form
from underlay.app.form import ADVANCED, ELSEWHERE, PRESETS, Draft, draft_from, preset, problem_with
from underlay.report.scene_tables import scene_table
from underlay.scene.scene_file import scene_file_from_text
from underlay.scene.scene_keys import scene_keys

# Sections that are always in the form, and those of other parts of the page; [simulate] is of made curves.
ALWAYS = {"indenter", "layer", "substrate", "substrate.layers", "fit"}
NOT_OF_A_MEASURED_CURVE = {"simulate"}


def key_of(section, name):
    return next(key for key in scene_keys() if (key.section, key.name) == (section, name))


def test_every_key_of_a_scene_file_has_a_field_or_another_place_on_the_page():
    sections = {key.section for key in scene_keys()}
    assert sections - NOT_OF_A_MEASURED_CURVE == ALWAYS | set(ADVANCED)
    declared = {(key.section, key.name) for key in scene_keys()}
    assert set(ELSEWHERE) <= declared
    draft = preset("film_on_wafer")
    shown = {field.key.name for field in draft.fields("curve")}
    assert {"segment", "preset", "fit_from", "fit_to", "overrule"} <= shown


@pytest.mark.parametrize("name", PRESETS)
def test_a_sample_is_a_whole_scene_and_survives_the_form(name):
    draft = preset(name)
    for section in ("indenter", "layer", "substrate", *ADVANCED):
        for field in draft.fields(section):
            draft.put(section, field.key, field.text)
    entered = scene_file_from_text(draft.text())
    assert entered.assumed == ()
    assert replace(scene_file_from_text(preset(name).text()), assumed=()) == entered


@pytest.mark.parametrize("name", PRESETS)
def test_every_number_of_a_sample_is_assumed_until_it_is_entered_confirmed_or_fitted(name):
    draft = preset(name)
    sections = ("indenter", "layer", "substrate")
    numbers = {
        field.path for part in sections for field in draft.fields(part) if field.key.kind and field.text
    }
    assert set(draft.assumed) == numbers
    assert set(draft.assumptions) == numbers - set(draft.free)
    draft.put("layer", key_of("layer", "nu"), "0.4")
    draft.confirm("indenter.radius")
    draft.free["layer.thickness"] = {}
    left = numbers - {"layer.nu", "indenter.radius", "layer.thickness", "layer.E"}
    assert set(Draft.of(draft.text()).assumptions) == left


def test_a_number_that_the_form_fills_in_is_assumed_and_stays_so_when_a_layer_above_it_goes():
    draft = preset("gel_on_glass")
    draft.choose_base("elastic")
    draft.add_layer()
    draft.add_layer()
    draft.put("substrate.layers[1]", key_of("substrate.layers", "nu"), "0.3")
    draft.set_axial("layer", axial=True)
    draft.remove_layer("substrate.layers[0]")
    filled = [path for path in draft.assumed if path.startswith("substrate") or "axial" in path]
    assert set(filled) == {
        *("substrate.E", "substrate.nu", "substrate.layers[0].E", "substrate.layers[0].thickness"),
        *("layer.E_axial", "layer.nu_axial", "layer.G_axial"),
    }
    assert set(scene_file_from_text(draft.text()).assumed) == set(draft.assumed)
    draft.choose_base("none")
    assert not any("substrate" in path for path in Draft.of(draft.text()).assumed)


@pytest.mark.parametrize(
    ("section", "name", "good", "bad"),
    [
        ("curve", "fit_from", "10 % of force", "10 % of luck"),
        ("curve", "fit_to", "0.5 radius", "120 % of force"),
        ("curve", "overrule", "indenter.radius, imprint", "everything"),
        ("curve", "segment", "unloading", "backwards"),
        ("lever", "spring_constant", "0.04 N/m", "soft"),
        ("indenter", "radius", "1 mm", "1 s"),
    ],
)
def test_what_a_field_takes_is_what_the_scene_file_takes(section, name, good, bad):
    key = key_of(section, name)
    assert problem_with(good, key) == ""
    assert problem_with(bad, key)
    draft = preset("cartilage_on_bone")
    draft.put(section, key, good)
    file = scene_file_from_text(draft.text())
    if section == "curve":
        assert file.curve[name]
    draft.table(section)[name] = bad
    with pytest.raises(ul.UnderlayError):
        scene_file_from_text(draft.text())


def test_a_list_of_one_is_written_with_a_comma():
    draft = preset("gel_on_glass")
    draft.table("layer")["relaxation"] = {"model": "prony"}
    draft.put("layer.relaxation", key_of("layer.relaxation", "fractions"), "0.3,")
    draft.put("layer.relaxation", key_of("layer.relaxation", "times"), "2 s,")
    relaxation = scene_file_from_text(draft.text()).draft.layer.relaxation
    assert (relaxation.fractions, relaxation.times) == ((0.3,), (2.0,))


def test_soft_tissue_is_entered_and_stands_in_the_description_of_the_test():
    draft = preset("gel_on_glass")
    for section, name, text in (
        ("indenter", "shape", "sphere"),
        ("layer", "half_width", "60 um"),
        ("layer", "shape", "block"),
        ("layer.stiffening", "model", "gent"),
        ("layer.stiffening", "inverse_limit", "0.5"),
        ("layer.stiffening", "height_spread", "0.1 um"),
    ):
        field = next(field for field in draft.fields(section) if field.key.name == name)
        assert not problem_with(text, field.key)
        draft.put(section, field.key, text)
    scene = scene_file_from_text(draft.text()).draft
    assert (scene.layer.half_width, scene.layer.shape) == (6e-5, "block")
    assert scene.layer.stiffening.inverse_limit == 0.5
    assert scene.layer.stiffening.height_spread == pytest.approx(1e-7)
    table = scene_table(scene).to_string()
    for told in ("gent", "0.5", "0.1 \u00b5m", "60 \u00b5m (block)"):
        assert told in table


def test_a_text_is_taken_whole_or_not_at_all():
    text = preset("gel_on_glass").text()
    draft = draft_from(text + '\n[curve]\nfile = "curves/a.csv"\n', ["a.csv"])
    assert draft.get("curve", "file") == "curves/a.csv"
    springs = text.replace('thickness = "6 um"', 'thickness = "6 um"\nbond = { normal = "1 GPa/m" }')
    assert springs != text
    assert "normal" in draft_from(springs, []).text()
    for wrong in ("no = [", text.replace("layer", "lair"), ""):
        with pytest.raises(ul.UnderlayError):
            draft_from(wrong, ["a.csv"])


@pytest.mark.parametrize("named", ["/etc/passwd", "../scene.toml", "curves/b.csv"])
def test_a_text_leads_to_no_file_outside_the_analysis(named):
    text = preset("gel_on_glass").text() + f'\n[curve]\nfile = "{named}"\n'
    with pytest.raises(ul.InputError, match="one of the files of step 1"):
        draft_from(text, ["a.csv"])


def test_what_is_fitted_must_be_a_section():
    with pytest.raises(ul.InputError, match="must be a section"):
        Draft.of("fit = 3")


@pytest.mark.parametrize(
    "path",
    ["layer.nu", "indenter.radius", "layer.relaxation.fractions", "curve.fit_from", "solver.order"],
)
@pytest.mark.parametrize("text", ["0,45", "1,000", "0,45 MPa", ",45", "1,234,567", "0,4, 0,3"])
def test_a_decimal_comma_is_no_list_of_two(path, text):
    section, _, name = path.rpartition(".")
    wrong = problem_with(text, key_of(section, name))
    assert ("a whole number" if name == "order" else "write numbers with a point, such as 0.45") in wrong
    assert repr(text.split()[0].rstrip(","))[1:-1] in wrong


def test_a_list_has_spaces_behind_its_commas():
    assert problem_with("0.4, 0.3", key_of("layer.relaxation", "fractions")) == ""
    assert "space behind each comma" in form.comma_problem("0.4, 0,3")
    assert "0.4, 0.3" in form.comma_problem("0.4, 0.3", may_list=False)


def test_names_and_values_are_taken_whole_or_not_at_all():
    assert form.pairs_of("depth = h (nm), force = -Fz (mN)") == {"depth": "h (nm)", "force": "-Fz (mN)"}
    assert form.pairs_of(" ") == {}
    with pytest.raises(ul.InputError, match="with a point"):
        form.pairs_of("spring_constant = 0,04 N/m, sensitivity = 60 nm/V")
    for wrong in ("depth h (nm)", "depth = h, deep (nm)", "= 3", "depth ="):
        with pytest.raises(ul.InputError, match="name = value"):
            form.pairs_of(wrong)
