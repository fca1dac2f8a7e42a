"""Make the pictures of README and pages: ``python notebooks/make_figures.py``. Those of pages need Chromium."""

import base64
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests"))

import matplotlib.pyplot as plt

import underlay as ul
from support.browser_page import choose, press, says, server, until
from support.chromium import browser as started
from underlay.report.plots.style import PAGE, style

SAMPLES, FIGURES = HERE.parent / "data_samples", HERE / "figures"


def main() -> None:
    """Fit the cartilage sample, draw it and what accuracy costs, make its report, photograph the tops of both pages."""
    fit = ul.fit(ul.load_problem(SAMPLES / "cartilage_on_bone.csv", SAMPLES / "cartilage_on_bone.toml"))
    FIGURES.mkdir(exist_ok=True)
    print("wrote", first(fit, FIGURES / "first.png"))
    print("wrote", cost(FIGURES / "cost.png"))
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


def first(fit: ul.Fit, target: Path) -> Path:
    """Draw the curve with its fit and residuals, and beside them E by depth of the layer and of the half-space."""
    with style():
        figure, (left, right) = plt.subplots(
            1, 2, figsize=(1.9 * PAGE, 3.4), layout="constrained", width_ratios=[1.3, 1]
        )
        ul.plots.fit(fit, ax=left)
        ul.plots.pointwise_modulus(fit.modulus_by_depth(), ax=right)
        right.set_title("")
        words = {
            "measured": "simulated curve",
            "half-space, same modulus": "half-space (Hertz), same modulus",
        }
        for panel in figure.axes:
            for text in panel.get_legend().get_texts() if panel.get_legend() else ():
                told = text.get_text()
                text.set_text(
                    "layer on substrate" if told.startswith("least-squares") else words.get(told, told)
                )
        figure.savefig(target, dpi=130)
        plt.close(figure)
    return target


def cost(target: Path) -> Path:
    """Draw error against time of every contact model, for a gel on glass."""
    scene = ul.Scene(ul.Paraboloid(5e-6), ul.Layer(ul.Isotropic(1.8e3, 0.5), 6e-6), ul.RIGID)
    table = ul.accuracy_cost(scene, 1.8e-6, rounds=9)
    with style():
        figure, axes = plt.subplots(figsize=(PAGE, 3.2), layout="constrained")
        ul.plots.accuracy_cost(table, ax=axes)
        figure.savefig(target, dpi=130)
        plt.close(figure)
    return target


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
