"""Make the pictures of the README: ``python notebooks/make_figures.py``. All but the first need Chromium."""

import base64
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests"))

import underlay as ul
from support.browser_page import choose, press, says, server, until
from support.chromium import browser as started

SAMPLES, FIGURES = HERE.parent / "data_samples", HERE / "figures"


def main() -> None:
    """Fit the cartilage sample, draw it, make its report, and photograph the tops of both pages."""
    fit = ul.fit(ul.load_problem(SAMPLES / "cartilage_on_bone.csv", SAMPLES / "cartilage_on_bone.toml"))
    FIGURES.mkdir(exist_ok=True)
    print("wrote", ul.plots.save(ul.plots.fit(fit), FIGURES / "fit.png"))
    browser = shutil.which("chromium")
    if browser is None:
        print("no chromium on this machine: figures/report.png and app.png are left as they are")
        return
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        page = ul.report(fit, Path(folder) / "report.html")
        options = "--headless --no-sandbox --disable-gpu --hide-scrollbars --no-first-run --disable-quic"
        quiet = "--disable-background-networking --disable-component-update --disable-sync"
        command = [browser, *options.split(), *quiet.split(), f"--user-data-dir={folder}/profile"]
        command += ["--window-size=900,1500", f"--screenshot={FIGURES / 'report.png'}", page.as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=120)
    print("wrote", FIGURES / "report.png")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        photograph_app(Path(folder), FIGURES / "app.png")
    print("wrote", FIGURES / "app.png")


def photograph_app(folder: Path, target: Path) -> None:
    """Fit the cartilage sample on the page of `underlay app`, and photograph what is seen then."""
    with started() as tab, server(folder) as (_, address):
        tab.open(address, width=1280, scheme="light")
        press(tab, "New analysis")
        choose(tab, SAMPLES / "cartilage_on_bone.csv")
        until(tab, says("loading 681"))
        press(tab, "Next: the test")
        press(tab, "Cartilage on bone")
        press(tab, "Next: the fit")
        until(tab, says("half-space"))
        press(tab, "Fit")
        until(tab, says("What acts in this test"))
        tab.evaluate("scrollTo(0, 0)")
        target.write_bytes(base64.b64decode(tab.call("Page.captureScreenshot", format="png")["data"]))


if __name__ == "__main__":
    main()
