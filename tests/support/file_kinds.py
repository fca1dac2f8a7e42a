"""Every kind of file that the program opens, for the fuzzing: valid ones to damage, and what reads them."""

import contextlib
import json
import warnings
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import underlay as ul
from support import afm_files, hand_overs, instrument_files, microscope_files
from support.posterior_cases import halfspace_curve, halfspace_problem, halfspace_scene
from underlay.cli.report import _Asked
from underlay.data.export import write_curves
from underlay.inference.batch.decisions import is_map, read_map
from underlay.inference.batch.manifest import read_manifest
from underlay.inference.journal import Journal, open_chain
from underlay.report import maps
from underlay.scene.scene_file import read_scene_file

SAMPLES = Path(__file__).resolve().parents[2] / "data_samples"
NAMES = ("layer.E", "layer.thickness")
IDENTITY = {"hashes": {"scene": "a" * 64, "curves": "b" * 64}, "columns": ["name", "layer.E"], "curves": 5}
CALIBRATION = {"spring_constant": "0.04 N/m", "sensitivity": "60 nm/nA"}
#: Readers by the first word of a curve file's name here.
FORMAT_OF = {
    "optics11": "optics11", "mach1": "mach1", "bioindenter": "bioindenter", "hysitron": "hysitron",
    "fischer": "fischer", "nanosuite": "nanosuite", "testxpert": "testxpert", "excel": "excel",
    "afm": "afm", "asylum": "asylum",
    "nanoscope": "nanoscope", "nanosurf": "nanosurf", "park": "park",
    "matlab": "matlab", "tdms": "tdms", "csv": "csv", "json": "json", "hdf5": "hdf5", "archive": None,
}  # fmt: skip


@dataclass(frozen=True)
class Seed:
    """A valid file: its kind, its name among them, its ending, its bytes, and what reads one like it."""

    kind: str
    name: str
    ending: str
    content: bytes
    read: Any


def seeds(folder):
    """Make every valid file, in the same order each time; `folder` is for those that are made on a disk."""
    makers = (_curves, _scenes, _manifests, _records, _posteriors, _chains, _maps, _journals)
    return [seed for make in makers for seed in make(Path(folder))]


def _curves(folder):
    files = {
        name: make()
        for name, make in {**instrument_files.ALL, **afm_files.ALL, **microscope_files.ALL}.items()
    }
    source = folder / "seed.csv"
    source.write_bytes(files["csv"])
    curves = ul.read_all(source)
    files |= hand_overs.kinds()
    for ending, name in ((".json", "json"), (".h5", "hdf5"), (".csv", "csv exported")):
        files[name] = write_curves(curves, folder / f"out{ending}").read_bytes()
    for name, content in sorted(files.items()):
        # By its content, and by the reader it was made for, past the recognition.
        for wanted in (None, FORMAT_OF[name.split()[0]]):
            keywords = {"calibration": CALIBRATION} if name == "afm ntmdt" else {}
            yield Seed("curve", name, ".dat", content, partial(_read_judged, format=wanted, **keywords))


def _read_judged(path, **keywords):
    """Read the curves of a file, judge and fit the first of them: each answers in words, whatever a curve holds.

    Returns how far the first curve came: "read", "judged" (it has a contact) or "fitted".
    """
    curves = ul.read_all(path, **keywords)
    came = "read"
    for curve in curves[:2]:
        ul.check_quality(curve)
        with contextlib.suppress(ul.UnderlayError):
            contact = ul.find_contact(curve)
            came = "judged" if curve is curves[0] else came
            if curve is curves[0]:
                instrument = ul.Instrument(contact_depth=contact.depth)
                scene = ul.Scene(ul.Paraboloid(1e-5), ul.Layer(ul.Isotropic(1e4, 0.5)), instrument=instrument)
                ul.fit(ul.Problem(scene, curve.loading(), {"layer.E": (1e-2, 1e13)}))
                came = "fitted"
    return came


def _scenes(_):
    for path in sorted(SAMPLES.glob("*.toml")):
        yield Seed("scene", path.stem, ".toml", path.read_bytes(), read_scene_file)


def _manifests(_):
    read = partial(read_manifest, scene=halfspace_scene())
    for separator in (",", ";"):
        rows = ("file", "name", "x (mm)", "y (mm)", "radius (um)"), ("a.csv", "A", "0", "1.5", "500")
        more = ("b.csv", "B", "1", "1.5", "510"), ("c.csv", "C", "2", "1.5 ", "0.5 mm")
        text = "".join(f"{separator.join(row)}\n" for row in (*rows, *more))
        yield Seed("manifest", separator, ".csv", text.encode(), read)


def _records(folder):
    result = ul.fit(halfspace_problem(_read_curve(folder)))
    record = result.to_json(folder / "x.fit.json").read_bytes()
    yield Seed("fit record", "fit", ".json", record, partial(_Asked, None))


def _read_curve(folder):
    """A curve that has a file, as those of records have."""
    path = write_curves([halfspace_curve(points=40)], folder / "curve.csv")
    return ul.read_all(path)[0]


def _posteriors(folder):
    path = folder / "posterior.npz"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ul.UnderlayWarning)  # so few steps do not converge
        few = {"walkers": 16, "max_steps": 60, "rng": 1, "progress": False}
        ul.sample(halfspace_problem(halfspace_curve(points=20)), **few).save(path)
    yield Seed("posterior", "posterior", ".npz", path.read_bytes(), _read_posterior)
    # Uncompressed, so that damage reaches the numbers and the document.
    with np.load(path) as file:
        np.savez(path, **{name: file[name] for name in file.files})
    yield Seed("posterior", "plain", ".npz", path.read_bytes(), _read_posterior)


def _read_posterior(path):
    posterior = ul.Posterior.load(path)
    repr(posterior)
    posterior.summary(derived=True)
    return posterior


def _chains(folder):
    path = folder / "a.chain"
    rng = np.random.default_rng(0)
    with open_chain(path, NAMES, 4, resume=False) as (file, _):
        for step in range(4):
            state = np.random.RandomState(step).get_state()
            file.append(rng.normal(size=(4, 2)), rng.normal(size=4), state, (10 * step, step))
    yield Seed("chain", "chain", ".chain", path.read_bytes(), _read_chain)


def _read_chain(path):
    with open_chain(path, NAMES, 4, resume=True) as (_, before):
        np.random.RandomState().set_state(before.random_state)


def _maps(folder):
    curves = [
        halfspace_curve(points=20, seed=number).with_metadata(name=f"site {number}") for number in range(3)
    ]
    ul.fit_many(
        curves,
        halfspace_scene(),
        {"layer.E": (1e4, 1e8)},
        output=folder / "map.csv",
        workers=1,
        options=ul.MapOptions(progress=False),
    )
    yield Seed("map", "csv", ".csv", (folder / "map.csv").read_bytes(), _read_map)
    read_map(folder / "map.csv").to_parquet(folder / "map.parquet")
    yield Seed("map", "parquet", ".parquet", (folder / "map.parquet").read_bytes(), _read_map)


def _read_map(path):
    is_map(path)
    table = read_map(path)
    for show in (maps.parameter_table, maps.failure_table, maps.columns_to_draw):
        show(table)
    maps.map_provenance_table(table, {})


def _journals(folder):
    path = folder / "map.journal"
    with _journal(path, resume=False) as journal:
        journal.append([(index, f"curve {index},{1.5e5 + index}") for index in range(4)])
    yield Seed("journal", "journal", ".journal", path.read_bytes(), _read_journal)


def _journal(path, *, resume):
    def is_row(number, text):
        return 0 <= number < IDENTITY["curves"] and text.count(",") == 1

    return Journal(path, json.loads(json.dumps(IDENTITY)), is_row, resume=resume)


def _read_journal(path):
    with _journal(path, resume=True) as journal:
        assert 0 <= journal.done <= IDENTITY["curves"]
        list(journal.lines())
