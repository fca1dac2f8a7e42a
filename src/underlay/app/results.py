"""Results on one curve for the page: its fit or its posterior; and the files that repeat the analysis.

All results are written as plain files. Sampling reports progress, can be stopped, and continues from its stored
chain.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from mimetypes import guess_type
from pathlib import Path
from string import Template
from urllib.parse import quote

from underlay._door import parse_json, read_bytes, read_text
from underlay._files import write_atomic
from underlay._version import VERSION
from underlay.app.folder import FILE, AnalysisFolder, keep, kept
from underlay.app.shown import Film, Found, Progress, Sampled, each_once
from underlay.app.state import Snapshot
from underlay.app.work import Tell
from underlay.data.curve import Curve
from underlay.errors import gathered_warnings
from underlay.inference.from_files import problem_from
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.sampling.run import sample
from underlay.inference.uncertainty.answer import Answer
from underlay.report.details import write_fit, write_posterior
from underlay.report.page import today
from underlay.report.page_fit import FitPage, PosteriorPage
from underlay.report.tables import notes_of

_WALKERS, _EVERY = 64, 10
_OPEN_NOISE = "looking for where to begin; no noise is stated, so it is averaged over, which takes longer"
_UNFINISHED = "Its intervals may be wrong: press Sample again, which goes on from there, or allow more steps."
# A date for every member, so that the same analysis is the same archive.
_DATE = (1980, 1, 1, 0, 0, 0)
_CRATE = "ro-crate-metadata.json"
# What every archive says of itself, and the script in it.
_CRATE_OF_ALL, _SCRIPT = map(Path(__file__).with_name, ("ro-crate.json", "analysis.py.txt"))


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
    text = Template(read_text(_SCRIPT, FILE)).substitute(curve=repr(curve_name), shown=shown)
    # Before a fit there is nothing to compare with.
    return text if values else text.partition("\n# What the page prints")[0]


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
    crate = parse_json(read_text(_CRATE_OF_ALL, FILE))
    about, root, software, fit = crate["@graph"]
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
    root |= {
        "name": f"Indentation test {tested.curve_name}",
        "hasPart": [{"@id": part["@id"]} for part in parts],
    }
    software["version"] = VERSION
    crate["@graph"] = [about, root, *parts, software, fit | {"object": inputs, "result": results}]
    return json.dumps(crate, indent=1).encode()


def _moved(content: bytes, places: Mapping[Path, str]) -> bytes:
    """Replace absolute paths in a table or in JSON by the place of the file in the archive, given by `places`."""
    for path, name in places.items():
        for known in dict.fromkeys((str(path.resolve()), str(path.absolute()), str(path))):
            for written in (json.dumps(known)[1:-1], known):
                content = content.replace(written.encode("utf-8", "surrogateescape"), name.encode())
    return content


def _zipped(members: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name, _DATE), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
