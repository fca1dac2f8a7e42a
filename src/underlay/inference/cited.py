"""The works to cite for the file of a result: a fit, a posterior, or the table of a map."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from underlay._door import FileKind, PathLike, parse_json, printable, read_start, read_text, understood
from underlay.errors import FileFormatError
from underlay.inference.batch.decisions import read_map
from underlay.inference.citation import Work, of_fit, of_sampling, used_by, work
from underlay.inference.sampling.posterior import Posterior

# The kind of a fit's file; the first bytes of a posterior's file; endings of a map's table.
_FIT = FileKind("the JSON of a fit", 100_000_000, "name the .fit.json that underlay fit wrote")
_ZIP = b"PK"
_TABLES = (".csv", ".parquet")


def cited(path: PathLike) -> list[tuple[Work, str]]:
    """Return the works that a result used, each with what it was used for.

    Parameters
    ----------
    path : path
        File of a result: ``*.fit.json``, ``*.posterior.npz`` or ``map.csv`` / ``map.parquet``.

    Raises
    ------
    FileAccessError
        If it cannot be read.
    FileFormatError
        If it is none of these.
    """
    start = read_start(path, 4)
    if start[:2] == _ZIP:
        used = _of_posterior(Posterior.load(path))
    elif start.lstrip()[:1] == b"{":
        used = _of_fit(path)
    elif Path(path).suffix.lower() in _TABLES:
        used = _of_map(path)
    else:
        raise FileFormatError(
            f"{printable(path)} is no result of underlay: name a .fit.json, a .posterior.npz or the table of a map"
        )
    return [(work(key), why) for key, why in used.items()]


def _of_posterior(posterior: Posterior) -> dict[str, str]:
    problem, diagnostics = posterior.problem, posterior.diagnostics
    sampling = of_sampling(chain=diagnostics.method == "emcee", mixture=diagnostics.importance is not None)
    if problem is None:
        return used_by(()) | sampling
    formats = [str(curve.metadata.get("format", "")) for curve in problem.curves]
    return used_by([problem.solver.name], problem.base_scenes, formats) | sampling


def _of_fit(path: PathLike) -> dict[str, str]:
    with understood(path, _FIT):
        document: Any = parse_json(read_text(path, _FIT))
        if "used" in document:
            return {str(key): str(why) for key, why in document["used"].items()}
        # Files from before fits stored the works they used.
        return used_by([str(document["statistics"]["law_method"])]) | of_fit(robust=False, averaged=False)


def _of_map(path: PathLike) -> dict[str, str]:
    table = read_map(path)
    laws = [str(law) for law in table.get("law", []) if isinstance(law, str)]
    used = used_by(laws) | of_fit(robust=False, averaged=False)
    return used | (of_sampling() if "converged" in table else {})
