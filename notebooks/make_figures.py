"""Make the pictures of the README: ``python notebooks/make_figures.py``. The second needs Chromium."""

import shutil
import subprocess
import tempfile
from pathlib import Path

import underlay as ul

HERE = Path(__file__).resolve().parent
SAMPLES, FIGURES = HERE.parent / "data_samples", HERE / "figures"


def main() -> None:
    """Fit the cartilage sample, draw it, make its report and photograph the top of the page."""
    fit = ul.fit(ul.load_problem(SAMPLES / "cartilage_on_bone.csv", SAMPLES / "cartilage_on_bone.toml"))
    FIGURES.mkdir(exist_ok=True)
    print("wrote", ul.plots.save(ul.plots.fit(fit), FIGURES / "fit.png"))
    browser = shutil.which("chromium")
    if browser is None:
        print("no chromium on this machine: figures/report.png is left as it is")
        return
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        page = ul.report(fit, Path(folder) / "report.html")
        options = "--headless --no-sandbox --disable-gpu --hide-scrollbars --no-first-run --disable-quic"
        quiet = "--disable-background-networking --disable-component-update --disable-sync"
        command = [browser, *options.split(), *quiet.split(), f"--user-data-dir={folder}/profile"]
        command += ["--window-size=900,1500", f"--screenshot={FIGURES / 'report.png'}", page.as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=120)
    print("wrote", FIGURES / "report.png")


if __name__ == "__main__":
    main()
