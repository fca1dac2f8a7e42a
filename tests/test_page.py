"""Pages of reports in a browser: pictures there, nothing fetched, readable narrow or wide, one sheet in print."""

from pathlib import Path

import pytest

import underlay as ul
from support.chromium import browser, chromium
from support.reports import joint_fit, sample_fit
from underlay.report import labels

opened = pytest.mark.skipif(chromium() is None, reason="no Chromium on this machine: the page is not opened")

WIDTHS, SCHEMES = (400, 820, 1280), ("light", "dark")

OVERFLOW = """
[...document.querySelectorAll('body *')].filter(e => {
  if (e.closest('.table, pre, svg')) return false;   // these scroll by themselves
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
    if (!own || !e.getClientRects().length || e.closest('svg')) continue;
    const a = lum(getComputedStyle(e).color), b = lum(ground(e));
    found.push([(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), parseFloat(getComputedStyle(e).fontSize),
      e.tagName + ': ' + e.textContent.trim().slice(0, 40)]);
  }
  return found;
})()
"""

PICTURES = """
[...document.querySelectorAll('svg[role=img]')].filter(i => !i.closest('details')).map(i => ({
  alt: i.getAttribute('aria-label'), shown: i.getBoundingClientRect().width,
  letters: Math.min(...[...i.querySelectorAll('text')].map(t => t.getBoundingClientRect().height))}))
"""


@pytest.fixture(scope="module")
def report_pages(tmp_path_factory):
    """The pages of a fit and of a joint fit, written."""
    folder = tmp_path_factory.mktemp("pages")
    fits = {"fit": sample_fit("cartilage_on_bone"), "joint": joint_fit()}
    return {name: ul.report(fit, folder / f"{name}.html") for name, fit in fits.items()}


# --- in a browser --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tab():
    with browser() as tab:
        yield tab


@opened
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("kind", ["fit", "joint"])
def test_page(report_pages, tab, kind, width, scheme):
    events = tab.open(report_pages[kind].as_uri(), width=width, scheme=scheme)

    errors = [e for e in events if e["method"] in {"Runtime.exceptionThrown", "Log.entryAdded"}]
    assert not errors, errors
    requests = [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]
    assert len(requests) == 1
    assert requests[0].startswith("file:")
    assert tab.evaluate("document.scripts.length") == 0

    pictures = tab.evaluate(PICTURES)
    assert len(pictures) == 4
    for picture in pictures:
        assert len(picture["alt"]) > 20, picture
        assert picture["shown"] > 180, picture
        assert picture["letters"] > (7.0 if width == 400 else 9.0), picture

    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    assert tab.evaluate(OVERFLOW) == []

    texts = tab.evaluate(CONTRAST)
    assert len(texts) > 20
    for contrast, size, text in texts:
        assert contrast >= 4.5, (contrast, text)
        assert size >= 11.5, (size, text)

    # Paper in every scheme: what is shown is what is printed.
    assert tab.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert tab.evaluate("document.documentElement.lang") == "en"
    assert len(tab.evaluate("document.title")) > 10
    assert tab.evaluate("document.querySelectorAll('h1').length") == 1


@opened
@pytest.mark.parametrize("name", ["cartilage_on_bone", "mach1_relaxation", "soft_film_on_softer_base"])
def test_the_sheet_is_one_page_of_a_pdf(name, tmp_path):
    written = ul.report(sample_fit(name), tmp_path / "page.html", pdf=True)
    assert written.name == "page.html"
    data = (tmp_path / "page.pdf").read_bytes()
    assert data.startswith(b"%PDF")
    assert data.count(b"/Type /Page\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"page.html", "page.pdf"}


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


@opened
@pytest.mark.parametrize("width", [820, 1280])
def test_a_table_with_long_names_stays_within_the_page(tab, tmp_path, width):
    styles = Path(labels.__file__).parent / "templates" / "page"
    style = "".join((styles / f"{part}.css").read_text(encoding="utf-8") for part in ("frame", "sheet"))
    name = "knee_left_condyle_site_17_" * 12
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
