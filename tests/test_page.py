"""Three pages of reports, made once: what stands in them, and how they look in a browser.

In the browser: every picture there, nothing fetched, readable narrow or wide, light or dark.
"""

import json
import re
from pathlib import Path

import pytest

import underlay as ul
from support.chromium import browser, chromium
from support.reports import SAMPLES, cells_of, joint_fit, page_text, small_posterior
from underlay.report import labels, words
from underlay.report.limits import distinct_scenes
from underlay.scene.effects import effects_table

opened = pytest.mark.skipif(chromium() is None, reason="no Chromium on this machine: the page is not opened")

WIDTHS, SCHEMES = (400, 1400), ("light", "dark")

OVERFLOW = """
[...document.querySelectorAll('body *')].filter(e => {
  if (e.closest('.table, pre')) return false;   // these scroll by themselves
  return e.getBoundingClientRect().right > document.documentElement.clientWidth + 1;
}).map(e => e.tagName + '.' + e.className)
"""

# Contrast of every text against the nearest ground behind it (WCAG 2.1, relative luminance).
CONTRAST = """
(() => {
  const rgb = c => c.match(/[\\d.]+/g).map(Number);
  const lum = c => { const [r, g, b] = rgb(c).slice(0, 3).map(v => (v /= 255) <= 0.03928 ? v / 12.92
    : ((v + 0.055) / 1.055) ** 2.4); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const ground = e => { for (; e; e = e.parentElement) { const c = getComputedStyle(e).backgroundColor;
    const p = rgb(c); if (p.length < 4 || p[3] > 0) return c; } return 'rgb(255, 255, 255)'; };
  const found = [];
  for (const e of document.querySelectorAll('body *')) {
    const own = [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim());
    if (!own || !e.getClientRects().length) continue;
    const a = lum(getComputedStyle(e).color), b = lum(ground(e));
    found.push([(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), parseFloat(getComputedStyle(e).fontSize),
      e.tagName + ': ' + e.textContent.trim().slice(0, 40)]);
  }
  return found;
})()
"""

PICTURES = """
[...document.images].map(i => ({alt: i.alt, src: i.src.slice(0, 22), complete: i.complete,
  natural: i.naturalWidth, shown: i.getBoundingClientRect().width}))
"""


@pytest.fixture(scope="module")
def report_pages(tmp_path_factory):
    """``{"fit": (fit, page), "joint": (fit, page), "posterior": (posterior, page)}``, the pages written."""
    folder = tmp_path_factory.mktemp("pages")
    problem = ul.load_problem(SAMPLES / "cartilage_on_bone.csv", SAMPLES / "cartilage_on_bone.toml")
    fit = ul.fit(problem)
    joint = joint_fit()
    _, posterior = small_posterior()
    return {
        "fit": (fit, ul.report(fit, folder / "fit.html")),
        "joint": (joint, ul.report(joint, folder / "joint.html")),
        "posterior": (posterior, ul.report(posterior, folder / "posterior.html")),
    }


def test_page_says_what_the_fit_found(report_pages):
    fit, page = report_pages["fit"]
    text = page_text(page)
    known = fit.interval("layer.E")
    assert words.quantity_with_interval(known.value, known.low, known.high, "pressure")[:-1] in text
    assert "known only together" in text
    for part in ("Data and fit", "The test", "Which effects matter", "Diagnostics", "Reservations"):
        assert part in text
    assert fit.provenance["curves"][0]["data_sha256"] in text
    assert fit.curves[0].metadata["sha256"] in text
    assert fit.provenance["versions"]["numpy"] in text


def test_notebook_beside_the_page_is_executed_and_gives_the_same_fit(report_pages):
    fit, page = report_pages["fit"]
    cells = cells_of(page.with_suffix(".ipynb"))
    assert all(cell["execution_count"] for cell in cells if cell["cell_type"] == "code")
    text = json.dumps(cells)
    assert "Traceback" not in text
    # The hash of the points the notebook fitted is that of the points of this fit, to the last bit.
    assert fit.provenance["curves"][0]["data_sha256"] in text


def test_page_of_a_joint_fit_shows_every_scene(report_pages):
    fit, page = report_pages["joint"]
    text = page_text(page)
    scenes = distinct_scenes(fit.scenes, fit.curves)
    assert [test.label for test in scenes] == ["curves 1 and 3", "curve 2"]
    for test in scenes:
        size = (
            effects_table(test.scene, test.deepest)
            .set_index("effect")
            .loc["finite thickness", "size_percent"]
        )
        assert re.search(rf"{labels.start(test.label)} effect .*finite thickness \+{size:.3g} % yes", text)
    # Of every curve its fit twice and its moduli by depth, of every scene its drawing and its effects;
    # correlations, and two profiles.
    assert page.read_text().count("<img") == 3 + 3 + 3 + 2 + 2 + 1 + 2


def test_segments_of_a_curve_that_only_goes_in_are_not_shown(report_pages):
    _, page = report_pages["fit"]
    assert "segments" not in json.dumps(cells_of(page.with_suffix(".ipynb")))
    assert not list(page.parent.glob("*.inputs/measured-*"))


def test_report_of_a_posterior(report_pages):
    posterior, page = report_pages["posterior"]
    text = page_text(page)
    assert "Layer modulus" in text
    assert ("The sampling converged" in text) == posterior.converged
    # It holds its own scene and curve: drawn, listed, and named by the hash of the points.
    median = posterior.samples["layer.E"].median()
    assert "Indenter, layer and substrate to scale at the median" in text
    assert f"Young's modulus E {median / 1e6:.4g} MPa" in text
    assert posterior.provenance["curves"][0]["data_sha256"] in text
    assert page.read_text().count("<img") == 3


# --- in a browser --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tab():
    with browser() as tab:
        yield tab


@opened
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("kind", ["fit", "joint", "posterior"])
def test_page(report_pages, tab, kind, width, scheme):
    events = tab.open(report_pages[kind][1].as_uri(), width=width, scheme=scheme)

    errors = [e for e in events if e["method"] in {"Runtime.exceptionThrown", "Log.entryAdded"}]
    assert not errors, errors
    requests = [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]
    assert requests[0].startswith("file:")
    assert all(url.startswith("data:") for url in requests[1:]), requests
    assert tab.evaluate("document.scripts.length") == 0

    pictures = tab.evaluate(PICTURES)
    assert len(pictures) >= (3 if kind == "posterior" else 5)
    for picture in pictures:
        assert picture["complete"], picture
        assert picture["natural"] > 300, picture
        assert picture["src"].startswith("data:image/png;base64"), picture
        assert len(picture["alt"]) > 20, picture
        # Pictures are drawn a journal column wide: shown at less than 70 % their letters get too small.
        assert picture["shown"] > 240, picture

    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    assert tab.evaluate(OVERFLOW) == []

    texts = tab.evaluate(CONTRAST)
    assert len(texts) > 50
    for contrast, size, text in texts:
        assert contrast >= 4.5, (contrast, text)
        assert size >= 12.0, (size, text)

    ground = tab.evaluate("getComputedStyle(document.body).backgroundColor")
    assert ground == ("rgb(255, 255, 255)" if scheme == "light" else "rgb(20, 23, 27)")
    assert tab.evaluate("document.documentElement.lang") == "en"
    assert len(tab.evaluate("document.title")) > 10
    assert tab.evaluate("document.querySelectorAll('h1').length") == 1


@opened
def test_the_checks_see_what_is_wrong(tab, tmp_path):
    page = tmp_path / "bad.html"
    page.write_text(
        "<p style='color:#ccc;background:#fff'>pale</p><div style='width:3000px'>wide</div>"
        "<img src='https://127.0.0.1:9/x.png'><script>undefined_name</script>",
        encoding="utf-8",
    )
    events = tab.open(page.as_uri(), width=400, scheme="light")
    assert any(e["method"] == "Runtime.exceptionThrown" for e in events)
    assert any(
        e["params"]["request"]["url"].startswith("https:")
        for e in events
        if e["method"] == "Network.requestWillBeSent"
    )
    assert tab.evaluate("document.documentElement.scrollWidth") > 400
    assert "DIV." in tab.evaluate(OVERFLOW)
    assert min(contrast for contrast, _, _ in tab.evaluate(CONTRAST)) < 2.0
    assert tab.evaluate(PICTURES)[0]["natural"] == 0


@opened
@pytest.mark.parametrize("width", [820, 1280])
def test_a_table_with_long_names_stays_within_the_page(tab, tmp_path, width):
    style = (Path(labels.__file__).parent / "templates" / "page" / "page.css").read_text(encoding="utf-8")
    name = "knee_left_condyle_site_17_" * 6
    page = tmp_path / "long.html"
    page.write_text(
        f"<style>{style}</style><main><div class='table'><table><tbody>"
        f"<tr><th>file {name}.csv</th><td>{name}</td></tr></tbody></table></div></main>",
        encoding="utf-8",
    )
    tab.open(page.as_uri(), width=width, scheme="light")
    table = "document.querySelector('table').getBoundingClientRect()"
    assert tab.evaluate(f"{table}.right") <= tab.evaluate(
        "document.querySelector('.table').getBoundingClientRect().right"
    )
    assert tab.evaluate(f"{table}.height") > 60.0  # it is broken into lines, not cut
