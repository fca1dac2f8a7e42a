"""Make the pictures of README and pages: ``python notebooks/make_figures.py``. Those of pages need Chromium."""

import base64
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests"))

import matplotlib.pyplot as plt

import underlay as ul
from support.browser_page import press, says, server, until
from support.chromium import Browser, chromium
from support.chromium import browser as started
from underlay.report.plots.style import PAGE, style

SAMPLES, FIGURES = HERE.parent / "data_samples", HERE / "figures"


def main() -> None:
    """Fit the cartilage sample, draw it and what accuracy costs, make its report, photograph the tops of both pages."""
    fit = ul.fit(ul.load_problem(SAMPLES / "cartilage_on_bone.csv", SAMPLES / "cartilage_on_bone.toml"))
    FIGURES.mkdir(exist_ok=True)
    print("wrote", first(fit, FIGURES / "first.png"))
    print("wrote", cost(FIGURES / "cost.png"))
    if chromium() is None:
        print("no chromium on this machine: figures/report.png and app.png are left as they are")
        return
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, started() as tab:
        page = ul.report(fit, Path(folder) / "report.html")
        tab.open(page.as_uri(), width=900, height=1500, scheme="light")
        print("wrote", photographed(tab, FIGURES / "report.png"))
        print("wrote", app(tab, Path(folder) / "home", FIGURES / "app.png"))


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


def app(tab: Browser, folder: Path, target: Path) -> Path:
    """Fit the cartilage sample on the page of `underlay app`, and photograph what is seen then."""
    with server(folder) as (_, address):
        tab.open(address, width=1280, height=1500, scheme="light")
        press(tab, "Cartilage on bone")
        until(tab, says("layer on substrate"))
        press(tab, "Fit", "button")
        until(tab, says("Effects that were considered"))
        tab.evaluate("scrollTo(0, 0)")
        return photographed(tab, target)


def photographed(tab: Browser, target: Path) -> Path:
    """Write what a window shows."""
    target.write_bytes(base64.b64decode(tab.call("Page.captureScreenshot", format="png")["data"]))
    return target


if __name__ == "__main__":
    main()
