"""`report`: write a result as one page, HTML or PDF."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from underlay._door import FileKind, read_bytes
from underlay._files import require_writable_folder, write_atomic
from underlay.errors import FileAccessError, InputError, MissingExtraError
from underlay.inference.least_squares.fit_result import Fit
from underlay.report.page import Page, today

if TYPE_CHECKING:
    from underlay.inference.problem import Problem
    from underlay.inference.sampling.posterior import Posterior

_PDF = ".pdf"
_PRINTED = FileKind("a PDF", 200_000_000, "print the HTML page to a file")
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
_ON_MACS = "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome"
_OPTIONS = ("--headless", "--disable-gpu", "--disable-extensions", "--no-first-run", "--no-pdf-header-footer")
# Seconds: a page is printed in two.
_LONGEST = 120


def report(
    result: Fit | Posterior | pd.DataFrame,
    path: str | os.PathLike[str] = "report.html",
    *,
    problem: Problem | None = None,
    pdf: bool = False,
    details: bool = False,
    command: str = "",
    files: Sequence[str | os.PathLike[str]] = (),
) -> Path:
    """Write a report: one self-contained A4 page as HTML, or as PDF.

    The page shows the number with both parts of its uncertainty, the verdict with cause and next step, the curve
    with fit and residuals, E by depth, the uncertainty budget, the test to scale, a methods paragraph with
    citation, and the provenance. Everything else is folded below it. The same result gives the same bytes on the
    same day.

    Parameters
    ----------
    result : Fit, Posterior or DataFrame
        What `fit`, `sample` or `fit_many` returned.
    path : path, default "report.html"
        The page; where it ends in ``.pdf`` the PDF alone is written.
    problem : Problem, optional
        The problem that was sampled, for a posterior that does not contain it, such as one from an older file.
    pdf : bool, default False
        Also write a PDF with the name of the HTML page; it is printed by a headless Chromium.
    details : bool, default False
        Unfold the parts below the page, also in print.
    command : str, optional
        Command line that repeats the result, for the page to state.
    files : sequence of path, optional
        Files that a posterior or a map was read from; the page states their hashes.

    Returns
    -------
    Path
        The page; the PDF where `path` is one.

    Raises
    ------
    InputError
        If `path` ends otherwise, `result` is none of these, or `problem` is not that of the posterior.
    FileAccessError
        If the folder cannot be written.
    MissingExtraError
        If a PDF is asked for and no Chromium is installed.
    """
    target = page_path(path)
    browser = _browser() if pdf or target.suffix.lower() == _PDF else ""
    html = _page(result, problem, command, [Path(file) for file in files]).html(opened=details)
    if target.suffix.lower() == _PDF:
        return _printed(html, target, browser)
    write_atomic(target, html)
    if pdf:
        _printed(html, target.with_suffix(_PDF), browser)
    return target


def _page(result: Any, problem: Problem | None, command: str, files: list[Path]) -> Page:
    """Return the page for the type of `result`; only the pictures of that one are loaded."""
    if isinstance(result, Fit):
        from underlay.report.page_fit import FitPage  # noqa: PLC0415  see above

        return FitPage(result, today(), command)
    if isinstance(result, pd.DataFrame):
        from underlay.report.page_map import MapPage  # noqa: PLC0415  see above

        return MapPage(result, today(), command, files)
    from underlay.inference.sampling.posterior import Posterior  # noqa: PLC0415  see above
    from underlay.report.page_fit import PosteriorPage  # noqa: PLC0415  see above

    if not isinstance(result, Posterior):
        raise InputError(f"a report is of a Fit, a Posterior or a map; got {type(result).__name__}")
    if problem is not None:
        if problem.names != result.names:
            raise InputError(
                f"this posterior is of {', '.join(result.names)}; the problem frees {', '.join(problem.names)}"
            )
        result = replace(result, problem=problem, missing="")
    return PosteriorPage(result, today(), command, files)


def page_path(path: str | os.PathLike[str]) -> Path:
    """Return `path` as an absolute path, checked to be one that a report can be written to.

    Raises
    ------
    InputError
        If it ends neither in ``.html`` nor in ``.pdf``.
    FileAccessError
        If its folder cannot be written.
    """
    target = Path(path).absolute()
    if target.suffix.lower() not in {".html", ".htm", _PDF}:
        raise InputError(f"a report is an HTML or PDF file, e.g. report.html; got {target.name!r}")
    require_writable_folder(target.parent)
    return target


def _browser() -> str:
    """Return the path of an installed Chromium or Chrome.

    Raises
    ------
    MissingExtraError
        If none is installed.
    """
    found = next((path for name in _BROWSERS if (path := shutil.which(name))), "")
    found = found or (_ON_MACS if Path(_ON_MACS).exists() else "")
    if not found:
        raise MissingExtraError(
            "a PDF is printed by Chromium or Chrome, and none is installed: install one, or open the HTML page and "
            "print it to a file"
        )
    return found


def _printed(html: str, target: Path, browser: str) -> Path:
    """Print an HTML page to a PDF file by a headless browser; return `target`."""
    with tempfile.TemporaryDirectory(prefix="underlay-", ignore_cleanup_errors=True) as folder:
        source, made = write_atomic(Path(folder) / "page.html", html), Path(folder) / "page.pdf"
        # Root has no sandbox to go into; the page has no script and fetches nothing.
        options = [*_OPTIONS, *(["--no-sandbox"] if getattr(os, "geteuid", lambda: 1)() == 0 else [])]
        command = [
            browser,
            *options,
            f"--user-data-dir={folder}/profile",
            f"--print-to-pdf={made}",
            source.as_uri(),
        ]
        try:
            subprocess.run(command, check=False, capture_output=True, timeout=_LONGEST)  # noqa: S603  no shell, our own words
        except (OSError, subprocess.TimeoutExpired) as error:
            raise FileAccessError(f"{browser} did not print the page: {error}") from error
        if not made.exists():
            raise FileAccessError(
                f"{browser} did not print the page; open the HTML page and print it to a file"
            )
        return write_atomic(target, read_bytes(made, _PRINTED))
