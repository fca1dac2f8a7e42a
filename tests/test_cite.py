"""What an analysis stands on: the right works for each result, confirmed DOIs, BibTeX that parses."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import underlay as ul
from support.populations import write_study
from support.reports import small_posterior
from underlay.inference.citation import bibtex, of_sampling, used_by, work, works
from underlay.inference.cited import cited
from underlay.mechanics.published.law import published_names

SCENE = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.5), 1.3e-3), ul.RIGID)
DEPTH = np.linspace(-1e-5, 8e-5, 80)


def keys_of(path):
    return {entry.key for entry, _ in cited(path)}


def fitted(tmp_path, scene=SCENE, **options):
    curve = ul.synthesize(scene, DEPTH, ul.Noise(force=1e-4), rng=0)
    return ul.fit(ul.Problem(scene, curve, {"layer.E": (1e4, 1e8)}, **options)).to_json(
        tmp_path / "a.fit.json"
    )


def test_a_fit_says_what_it_used(tmp_path):
    keys = keys_of(fitted(tmp_path, noise=ul.Noise()))
    assert {"underlay", "argatov_sabina", "marquardt1963", "harris2020", "virtanen2020"} <= keys
    # Nothing that was not used is cited.
    assert not keys & {"foreman_mackey2013", "johnson1971", "lmfit", "dunkin1965", "kennedy2001"}
    assert "kennedy2001" in keys_of(fitted(tmp_path))


def test_a_published_correction_is_cited_with_its_doi(tmp_path):
    path = fitted(tmp_path, noise=ul.Noise(), solver="garcia2018")
    found = {entry.key: entry for entry, _ in cited(path)}
    assert found["garcia2018"].doi == "10.1016/j.bpj.2018.05.012"
    assert "argatov_sabina" not in found


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"adhesion": ul.JKR(1e-3)}, "johnson1971"),
        ({"adhesion": ul.DMT(1e-3)}, "derjaguin1975"),
        ({"adhesion": ul.Maugis(1e-3, 1e-8)}, "maugis1992"),
        ({"friction": "stuck"}, "spence1968"),
        ({"substrate": ul.Stack([ul.Layer(ul.Isotropic(1e7, 0.3), 1e-4)], ul.RIGID)}, "dunkin1965"),
        ({"layer": replace(SCENE.layer, relaxation=ul.Prony((0.5,), (1.0,)))}, "lee1960"),
    ],
)
def test_each_thing_modelled_is_cited(change, key):
    assert key not in used_by(["exact"], [SCENE])
    assert key in used_by(["exact"], [replace(SCENE, **change)])


def test_a_program_that_read_the_file_is_cited():
    assert "igor2" in used_by(["exact"], [SCENE], ["asylum"])
    assert "igor2" not in used_by(["exact"], [SCENE], ["csv"])


def test_weighted_draws_alone_cite_no_chain():
    assert of_sampling(chain=False, mixture=True) == {"raftery2010": "draws along the ridges"}


def test_a_posterior_cites_its_sampler(tmp_path):
    posterior = small_posterior()[1]
    posterior.save(tmp_path / "a.posterior.npz")
    keys = keys_of(tmp_path / "a.posterior.npz")
    assert {"foreman_mackey2013", "vehtari2021", "goodman2010"} <= keys
    assert "marquardt1963" not in keys
    assert ("raftery2010" in keys) == (posterior.diagnostics.importance is not None)


def test_the_table_of_a_map_cites_its_laws(tmp_path):
    write_study(tmp_path / "map.csv", group="group")
    keys = keys_of(tmp_path / "map.csv")
    assert "underlay" in keys
    assert "foreman_mackey2013" not in keys


def test_a_fit_of_before_is_cited_by_its_law(tmp_path):
    path = tmp_path / "old.fit.json"
    path.write_text(json.dumps({"statistics": {"law_method": "dimitriadis2002"}}), encoding="utf-8")
    assert "dimitriadis2002" in keys_of(path)


@pytest.mark.parametrize(
    "content", [b"name,value\n1,2\n", b"", b'{"values": {}}', b'{"used": [1]}', b"PK\x03\x04"]
)
def test_what_is_no_result_is_refused(content, tmp_path):
    path = tmp_path / "other.dat"
    path.write_bytes(content)
    with pytest.raises(ul.FileFormatError, match=r"other\.dat"):
        cited(path)


def test_a_key_from_a_file_is_looked_up_and_never_printed_as_it_is(tmp_path):
    path = tmp_path / "a.fit.json"
    path.write_text(json.dumps({"used": {"}\\input{secret}": "harm"}}), encoding="utf-8")
    with pytest.raises(ul.InputError, match="nothing to cite"):
        cited(path)


def test_every_correction_can_be_cited():
    for correction in ul.published_corrections():
        entry = work(correction.name)
        assert entry.doi == (correction.doi or "")
        assert str(entry.year) in correction.name
        assert correction.name.startswith(entry.authors[0].lower())
    assert len(published_names()) >= 11


def test_every_doi_is_confirmed_in_the_tree_or_by_a_note():
    # Those that stand beside the code they belong to; the others were met in the publishers' or authors' own pages.
    source = "".join(path.read_text(encoding="utf-8") for path in (Path(ul.__file__).parent).rglob("*.py"))
    elsewhere = {"harris2020", "virtanen2020", "johnson1971", "derjaguin1975", "maugis1992"}
    for entry in works().values():
        assert not entry.doi or entry.key in elsewhere or entry.doi in source, entry.key


def test_bibtex_is_bibtex():
    text = bibtex(work(key) for key in [*works(), *published_names()])
    entries = re.findall(
        r"^@(article|software)\{([a-z_0-9-]+),\n((?:  \w+ = \{.*\},\n)+)\}$", text, re.MULTILINE
    )
    assert len(entries) == text.count("@") == len({key for _, key, _ in entries})
    for _, _, body in entries:
        assert body.count("{") == body.count("}")
        assert "author = {" in body


def test_the_command_prints_and_writes(done, tmp_path):
    path = fitted(tmp_path, noise=ul.Noise())
    assert "doi:10.1038/s41592-019-0686-2" in done("cite", path, "--output", tmp_path)
    assert (tmp_path / "a.bib").read_text(encoding="utf-8").startswith("@software{underlay")
