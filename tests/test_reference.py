"""The reference: pages made from the declarations, and a search for links that finds those that lead nowhere."""

import importlib.util
from pathlib import Path

import pytest

from underlay.scene.scene_keys import scene_keys

FOLDER = Path(__file__).resolve().parents[1] / ".reference"


@pytest.fixture(scope="module")
def build():
    pytest.importorskip("pdoc", reason="pdoc is not installed: the extra reference")
    spec = importlib.util.spec_from_file_location("build_reference", FOLDER / "build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_key_has_its_row(build):
    page = build.keys_page()
    for key in scene_keys():
        assert f"| `{key.key}` |" in page
    made = build.markdown(page)
    assert made.count("<tr>") >= len(scene_keys())


def test_every_command_is_there_with_its_options(build):
    page = build.commands_page()
    for name in ("fit", "map", "benchmark", "cite", "keys"):
        assert f"## underlay {name}\n" in page
    assert "`--scene -s`" in page


def test_links_that_lead_nowhere_are_found(build, tmp_path):
    (tmp_path / "inner").mkdir()
    page = '<a href="{}">x</a><h1 id="here">y</h1>'
    for name, target in {
        "good": "inner/other.html#here",
        "self": "#here",
        "far": "https://example.org/none",
        "gone": "none.html",
        "anchor": "good.html#there",
        "inner/other": "../good.html",
    }.items():
        (tmp_path / f"{name}.html").write_text(page.format(target))
    assert sorted(build.broken_links(tmp_path)) == ["anchor.html: good.html#there", "gone.html: none.html"]


def test_cells_hold_no_markup_of_their_own(build):
    assert build.cell("a|b\n<script>") == "a\\|b &lt;script>"
