"""Results on one curve for the page: its fit, its posterior or the moduli of a film; and what is taken away.

All results are written as plain files. Sampling reports progress, can be stopped, and continues from its stored
chain; a film is fitted to its contact stiffness S(h), as by `underlay film`. Downloads are the analysis as files
that repeat it, a report, and spreadsheets.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from mimetypes import guess_type
from pathlib import Path
from urllib.parse import quote

import pandas as pd

from underlay._door import read_bytes
from underlay._files import write_atomic
from underlay._version import VERSION
from underlay.app.folder import FILE, AnalysisFolder, keep, kept
from underlay.app.many import judged_table
from underlay.app.shown import Film, Found, Progress, Row, Sampled, each_once
from underlay.app.state import Snapshot
from underlay.app.work import Tell
from underlay.data.curve import Curve
from underlay.errors import InputError, gathered_warnings
from underlay.inference.films import fit_film
from underlay.inference.from_files import problem_from
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.pointwise.result import PointwiseModulus
from underlay.inference.sampling.run import sample
from underlay.inference.uncertainty.answer import Answer
from underlay.report.details import pointwise_of, write_fit, write_posterior
from underlay.report.excel import excel_bytes
from underlay.report.film_tables import film_notes, film_table, write_film
from underlay.report.labels import label
from underlay.report.page import today
from underlay.report.page_fit import FitPage
from underlay.report.page_posterior import PosteriorPage
from underlay.report.render import report
from underlay.report.tables import notes_of

_WALKERS, _EVERY = 64, 10
_OPEN_NOISE = "looking for where to begin; no noise is stated, so it is averaged over, which takes longer"
_UNFINISHED = "Its intervals may be wrong: press Sample again, which goes on from there, or allow more steps."
# A date for every member, so that the same analysis is the same archive.
_DATE = (1980, 1, 1, 0, 0, 0)
_CRATE = "ro-crate-metadata.json"


def tell_found(folder: AnalysisFolder, tested: Snapshot, result: Fit, tell: Tell) -> Found:
    """Send the numbers of a fit to the page, then all of its report; write the files that `underlay fit` writes.

    Parameters
    ----------
    folder : AnalysisFolder
        The analysis; results of an earlier fit of the curve are deleted.
    tested : Snapshot
        The scene and curve that were fitted: the form may have changed since.
    result : Fit
        The fit.
    tell : callable
        Called with a `Found` twice: with the numbers alone, then with the pictures.
    """
    for old in folder.result_files(tested.stem, (".csv", ".json", ".png"), ("found",)):
        old.unlink()
    page = FitPage(result, today())
    values = {name: _exact(result.answer(name)) for name in (*result.names, *result.derived)}
    notes = each_once(*notes_of(*result.curves))
    found = Found(tested.stem, tested.of, tested.text, values, page.head(), notes)
    tell(found)
    found = replace(found, sheet=page.sheet())
    keep(folder, tested.stem, found)
    write_fit(result, folder.results, tested.stem)
    tell(found)
    return found


def _exact(known: Answer) -> list[str]:
    """Return value, low and high end, and the ends of the statistical part (SI), with all digits."""
    numbers = (known.value, known.low, known.high, known.statistical.low, known.statistical.high)
    return [repr(float(number)) for number in numbers]


def sample_posterior(
    folder: AnalysisFolder, tested: Snapshot, curve: Curve, most: int, tell: Tell
) -> Sampled:
    """Sample until the chain has converged, `most` steps are done or a stop was asked for; write the results.

    Parameters
    ----------
    folder : AnalysisFolder
        Where chain and posterior are written; a chain of the same test and `most` is continued.
    tested : Snapshot
        The test that is sampled.
    curve : Curve
        The points to fit.
    most : int
        Maximum number of steps.
    tell : callable
        Called with a `Progress` during the run.
    """
    file, stem, of = tested.file, tested.stem, tested.of
    chain = folder.result(f"{stem}.chain")
    mark = f"{of} {most}".encode()
    if folder.read_result(f"{stem}.chain.txt") != mark:
        chain.unlink(missing_ok=True)
    write_atomic(folder.result(f"{stem}.chain.txt"), mark)

    def step(done: int, needed: int, effective: float) -> None:
        if done % _EVERY == 0:
            words = f"{done} of about {needed} steps; {effective:.0f} effective samples so far"
            tell(Progress(done, needed, words))

    with gathered_warnings() as notes:
        problem = problem_from(file, curve)
        tell(Progress(0, most, _OPEN_NOISE if problem.noise_is_open else "looking for where to begin"))
        posterior = sample(problem, _WALKERS, most, backend=chain, resume=chain.exists(), progress=step)
    write_posterior(posterior, folder.results, stem)
    if not posterior.converged:
        # What the sampler warns of is the verdict already; what to do about it is not.
        notes = [_UNFINISHED, *(note for note in notes if posterior.diagnostics.reason not in note)]
    sampled = Sampled(of, PosteriorPage(posterior, today()).sheet(), each_once(*notes))
    keep(folder, stem, sampled)
    return sampled


def film_rows(table: pd.DataFrame) -> tuple[Row, ...]:
    """Return the rows of `film_table` with parameters called by their names for people."""
    rows = table.assign(parameter=[label(name) for name in table["parameter"]]).to_dict("records")
    return tuple({str(key): str(value) for key, value in row.items()} for row in rows)


def film_of(folder: AnalysisFolder, tested: Snapshot, base: str, modulus: str, ends: tuple[str, str]) -> Film:
    """Fit the moduli of a film to the contact stiffness of the selected curve.

    Parameters
    ----------
    folder : AnalysisFolder
        Holds both files.
    tested : Snapshot
        The test; its indenter is a cone.
    base : str
        File of a test on a sample of known modulus with the same tip; empty for a perfect tip.
    modulus : str
        E / (1 - nu^2) of that sample, with its unit.
    ends : (str, str)
        Shallowest and deepest depth that are fitted, with units.

    Raises
    ------
    CurveError, InputError
        As `underlay film`.
    """
    curve = folder.curve_file(tested.curve_name)
    if base and not modulus.strip():
        raise InputError('the known sample needs its modulus, such as "165 GPa" for (001) silicon')
    calibration = folder.curve_file(base) if base else None
    found = fit_film(tested.file, curve, calibration, modulus or None, ends)
    write_film(found, folder.results, tested.stem)
    notes = tuple(film_notes(found, perfect=not base))
    film = Film(tested.of, notes, film_rows(film_table(found)), f"{tested.stem}.film.png")
    keep(folder, tested.stem, film)
    return film


# --- what is taken away --------------------------------------------------------------------------------------


def script(curve_name: str, values: Mapping[str, Sequence[str]]) -> str:
    """Return a Python script that repeats the fit from ``scene.toml`` and the curve in ``curves`` beside it.

    Parameters
    ----------
    curve_name : str
        File name of the curve.
    values : mapping of str to sequence of str
        Numbers that the page shows (`Found.values`), which the script compares with its own. Empty before a fit.
    """
    shown = "".join(f"    {name!r}: ({', '.join(numbers)}),\n" for name, numbers in values.items())
    compare = (
        "# What the page prints (SI): the value, its 95 % interval, and the part of noise and misfit in that.\n"
        f"shown = {{\n{shown}}}\n"
        "for name, numbers in shown.items():\n"
        "    known = fit.answer(name)\n"
        "    part = known.statistical\n"
        "    same = (known.value, known.low, known.high, part.low, part.high) == numbers\n"
        "    print(name, 'is as on the page' if same else 'differs from the page')\n"
    )
    return (
        '"""The analysis of the page, as Python: the same curve, the same scene, the same numbers."""\n\n'
        "from math import inf\n"
        "from pathlib import Path\n\n"
        "import underlay as ul\n\n"
        "here = Path(__file__).parent\n"
        f"problem = ul.load_problem(here / 'curves' / {curve_name!r}, here / 'scene.toml')\n"
        "fit = ul.fit(problem)\n"
        "for name in (*fit.names, *fit.derived):\n"
        "    known = fit.answer(name)\n"
        "    print(f'{name} {known.value:.6g} ({known.low:.6g} to {known.high:.6g})')\n"
        "print(f'verdict: {fit.verdict}')\n" + (f"\n{compare}" if values else "")
    )


def fitted_test(folder: AnalysisFolder, now: Snapshot) -> tuple[Found, Snapshot]:
    """Return the stored fit of the selected curve, and the scene and curve that were fitted.

    Raises
    ------
    InputError
        If the curve was not fitted, or its file has changed since.
    """
    found = kept(folder, now.stem, Found)
    if found is None:
        raise InputError("press Fit first: what is taken away is of a fit")
    tested = Snapshot.from_text(folder, found.scene)
    if tested.of != found.of:
        raise InputError(f"{now.curve_name} is not the file that was fitted: press Fit again")
    return found, tested


def analysis_archive(folder: AnalysisFolder, found: Found, tested: Snapshot) -> bytes:
    """Return scene, script, curve and results as a ZIP archive that is an RO-Crate (research object).

    Results of another test, such as a posterior of another depth range, are left out.
    """
    curve = folder.curve_file(tested.curve_name)
    members = {
        "scene.toml": tested.text.encode(),
        "analysis.py": script(curve.name, found.values).encode(),
        f"curves/{curve.name}": read_bytes(curve, FILE),
    }
    scene = folder.result(f"{tested.stem}.scene.toml")
    places = {curve: f"curves/{curve.name}", scene: "scene.toml"}
    made_by = ["found"]
    sampled, film = kept(folder, tested.stem, Sampled), kept(folder, tested.stem, Film)
    made_by += ["sampled"] if sampled is not None and sampled.of == found.of else []
    made_by += ["film"] if film is not None and film.of == found.of else []
    for path in folder.result_files(tested.stem, (".csv", ".json", ".png"), made_by):
        content = read_bytes(path, FILE)
        members[f"results/{path.name}"] = content if path.suffix == ".png" else _moved(content, places)
    members[_CRATE] = crate(tested, members)
    return _zipped(members)


def crate(tested: Snapshot, members: Collection[str]) -> bytes:
    """Return the JSON that describes the files of an archive (RO-Crate 1.1, https://w3id.org/ro/crate/1.1)."""
    software = {"@id": "#underlay", "@type": "SoftwareApplication", "name": "underlay", "version": VERSION}
    parts = [
        {
            "@id": quote(name),
            "@type": "File",
            "name": name,
            "encodingFormat": guess_type(name)[0] or "text/plain",
        }
        for name in members
    ]
    results = [{"@id": part["@id"]} for part in parts if part["name"].startswith("results/")]
    inputs = [{"@id": part["@id"]} for part in parts if not part["name"].startswith("results/")]
    fit = {"@id": "#fit", "@type": "CreateAction", "instrument": {"@id": software["@id"]}}
    about = {"@id": _CRATE, "@type": "CreativeWork", "about": {"@id": "./"}}
    about["conformsTo"] = {"@id": "https://w3id.org/ro/crate/1.1"}
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": f"Indentation test {tested.curve_name}",
        "description": "Young's modulus of a layer from an indentation curve: curve, test, script and results.",
        "hasPart": [{"@id": part["@id"]} for part in parts],
        "mentions": {"@id": "#fit"},
    }
    graph = [about, root, *parts, software, fit | {"object": inputs, "result": results}]
    return json.dumps(
        {"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph}, indent=1
    ).encode()


def _moved(content: bytes, places: Mapping[Path, str]) -> bytes:
    """Replace absolute paths in a table or in JSON by the place of the file in the archive, given by `places`."""
    for path, name in places.items():
        for known in dict.fromkeys((str(path.resolve()), str(path.absolute()), str(path))):
            for written in (json.dumps(known)[1:-1], known):
                content = content.replace(written.encode("utf-8", "surrogateescape"), name.encode())
    return content


def workbook_of(result: Fit) -> bytes:
    """Return the Excel file of a fit, with its modulus at each depth where there is one."""
    by_depth = [found for found in pointwise_of(result) if isinstance(found, PointwiseModulus)]
    return excel_bytes(result, *by_depth)


def map_workbook(folder: AnalysisFolder) -> bytes:
    """Return the Excel file of the map, with the decisions by hand and the scene that was fitted."""
    scene = (folder.read_result("map.scene.toml") or b"").decode()
    return excel_bytes(judged_table(folder), settings={"scene": scene[:30_000]})


def report_page(folder: AnalysisFolder, result: Fit, stem: str) -> bytes:
    """Return the report of a fit as HTML, as `underlay report` makes it."""
    return read_bytes(report(result, folder.results / f"{stem}.report.html"), FILE)


def _zipped(members: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name, _DATE), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
