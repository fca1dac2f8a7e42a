"""Downloads from the page: the analysis as files that repeat it, a report, a spreadsheet."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Collection, Mapping, Sequence
from mimetypes import guess_type
from pathlib import Path
from urllib.parse import quote

from underlay._door import FileKind, read_bytes
from underlay._version import VERSION
from underlay.app.folder import AnalysisFolder, kept
from underlay.app.many import judged_table
from underlay.app.shown import Film, Found, Sampled
from underlay.app.state import Snapshot
from underlay.errors import InputError
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.pointwise.result import PointwiseModulus
from underlay.report.details import pointwise_of
from underlay.report.excel import excel_bytes
from underlay.report.render import report

_KIND = FileKind("a file of an analysis", 4_000_000_000, "start a new analysis")
# A date for every member, so that the same analysis is the same archive.
_DATE = (1980, 1, 1, 0, 0, 0)
_CRATE = "ro-crate-metadata.json"


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
        f"curves/{curve.name}": read_bytes(curve, _KIND),
    }
    scene = folder.result(f"{tested.stem}.scene.toml")
    places = {curve: f"curves/{curve.name}", scene: "scene.toml"}
    made_by = ["found"]
    sampled, film = kept(folder, tested.stem, Sampled), kept(folder, tested.stem, Film)
    made_by += ["sampled"] if sampled is not None and sampled.of == found.of else []
    made_by += ["film"] if film is not None and film.of == found.of else []
    for path in folder.result_files(tested.stem, (".csv", ".json", ".png"), made_by):
        content = read_bytes(path, _KIND)
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
    return read_bytes(report(result, folder.results / f"{stem}.report.html"), _KIND)


def _zipped(members: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name, _DATE), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
