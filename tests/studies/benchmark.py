"""The open benchmark of layered indentation: how its files are made, and how well everybody does on it.

    python tests/studies/benchmark.py make [FOLDER]   # data_samples/benchmark, but for finite_elements.csv
    python tests/studies/benchmark.py finite_elements # that one: minutes
    python tests/studies/benchmark.py score           # -> results/benchmark.csv, and the table of its page

`make` gives the same bytes each time. Curves are made from scenes whose truth is known: one kind of sample for each
thing that a formula may leave out, and each in five worlds of noise. The contact references are those of
`support/reference_solver`, which shares nothing with the library.
"""

from __future__ import annotations

import csv
import io
import json
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import underlay as ul
from support.finite_elements import Layer, Press, Tip
from support.nanite_curves import indentation
from support.reference_solver import EXPONENTS, MATERIALS, STORED

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "data_samples" / "benchmark"
#: Holds the table of scores.
PAGE = ROOT / ".reference" / "pages" / "comparison.md"
RESULTS = Path(__file__).parent / "results" / "benchmark.csv"
MADE = "made by: python tests/studies/benchmark.py make"
POINTS = 200

# --- six kinds of sample ---------------------------------------------------------------------------------

# What a user is told of friction and large strains is so.
PLAIN = {"friction": "none", "finite_strain": False}


@dataclass(frozen=True)
class Kind:
    """One kind of sample: the scene that makes its curves, the motion of the tip, and what a user is told.

    Parameters
    ----------
    about : str
        What it is, in a line.
    scene : Scene
        With the truth.
    corners : tuple of (float, float)
        Depth reading since first contact (m) and time (s) at the corners of the motion.
    starts : mapping
        What a user does not know: numbers of the scene at which a fit begins.
    fit : str
        The [fit] section.
    segment : str
        Which part of the curve is fitted.
    """

    about: str
    scene: ul.Scene
    corners: tuple[tuple[float, float], ...]
    starts: Mapping[str, float]
    fit: str
    segment: str = "loading"

    @property
    def motion(self):
        """Depths since first contact (m) and times (s)."""
        depths, times = np.array(self.corners).T
        time = np.linspace(times[0], times[-1], POINTS)
        return np.interp(time, times, depths), time


KINDS = {
    "elastic": Kind(
        "a colloidal probe on a soft gel on glass: linear, frictionless, bonded",
        ul.Scene(ul.Sphere(5e-6), ul.Layer(ul.Isotropic(2e3, 0.5), 6e-6), ul.RIGID, **PLAIN),
        ((-1e-6, 0.0), (1.5e-6, 1.0)),
        {"layer.E": 1e4},
        'layer.E = { min = "10 Pa", max = "1 MPa" }\n'
        'instrument.contact_depth = { min = "-2 um", max = "2 um" }\ninstrument.baseline = {}\n',
    ),
    "stuck": Kind(
        "a ball on thin cartilage: points stick where the tip touches them",
        ul.Scene(
            ul.Sphere(1e-3),
            ul.Layer(ul.Isotropic(1e6, 0.49), 3e-4),
            ul.RIGID,
            **PLAIN | {"friction": "stuck"},
        ),
        ((-2e-5, 0.0), (5e-5, 1.0)),
        {"layer.E": 3e6},
        'layer.E = { min = "10 kPa", max = "100 MPa" }\n'
        'instrument.contact_depth = { min = "-50 um", max = "50 um" }\ninstrument.baseline = {}\n',
    ),
    "finite_strain": Kind(
        "a ball pressed a quarter of its radius into a neo-Hookean gel as thick as that: finite elements",
        ul.Scene(
            ul.Sphere(1e-5),
            ul.Layer(ul.Isotropic(8e3, 0.3), 1e-5),
            ul.RIGID,
            friction="none",
            finite_strain=True,
        ),
        ((-1e-6, 0.0), (2.5e-6, 1.0)),
        {"layer.E": 2e4},
        'layer.E = { min = "10 Pa", max = "1 MPa" }\n'
        'instrument.contact_depth = { min = "-2 um", max = "2 um" }\ninstrument.baseline = {}\n',
    ),
    "stacked": Kind(
        "a soft film on a stiffer film on glass",
        ul.Scene(
            ul.Paraboloid(1e-5),
            ul.Layer(ul.Isotropic(5e4, 0.45), 5e-6),
            ul.Stack([ul.Layer(ul.Isotropic(5e5, 0.4), 1e-5)], ul.RIGID),
            **PLAIN,
        ),
        ((-0.5e-6, 0.0), (1e-6, 1.0)),
        {"layer.E": 2e5},
        'layer.E = { min = "100 Pa", max = "100 MPa" }\n'
        'instrument.contact_depth = { min = "-2 um", max = "2 um" }\ninstrument.baseline = {}\n',
    ),
    "relaxing": Kind(
        "a ball held on a layer that relaxes: what is asked for is the modulus at once",
        ul.Scene(
            ul.Paraboloid(2e-3),
            ul.Layer(ul.Isotropic(5e5, 0.5), 2e-3, relaxation=ul.Prony((0.3, 0.2), (0.5, 5.0))),
            ul.RIGID,
            **PLAIN,
        ),
        ((-5e-5, 0.0), (2e-4, 2.5), (2e-4, 10.0)),
        {"layer.E": 2e6, "layer.relaxation.fractions[0]": 0.2, "layer.relaxation.fractions[1]": 0.3},
        'layer.E = { min = "10 kPa", max = "100 MPa" }\n'
        '"layer.relaxation.fractions[0]" = { min = 0, max = 1 }\n'
        '"layer.relaxation.fractions[1]" = { min = 0, max = 1 }\n'
        'instrument.contact_depth = { min = "-50 um", max = "100 um" }\ninstrument.baseline = {}\n',
        "all",
    ),
    "adhesive": Kind(
        "a colloidal probe drawn off a sticky gel on glass (JKR)",
        ul.Scene(
            ul.Paraboloid(5e-6),
            ul.Layer(ul.Isotropic(2e4, 0.5), 5e-6),
            ul.RIGID,
            adhesion=ul.JKR(work=1e-4),
            **PLAIN,
        ),
        ((0.5e-6, 0.0), (-0.5e-6, 1.0)),
        {"layer.E": 1e5, "adhesion.work": 3e-4},
        'layer.E = { min = "100 Pa", max = "10 MPa" }\n'
        'adhesion.work = { min = "1 uJ/m^2", max = "10 mJ/m^2" }\n'
        'instrument.contact_depth = { min = "-1 um", max = "1 um" }\ninstrument.baseline = {}\n',
        "unloading",
    ),
}

# --- five worlds of noise --------------------------------------------------------------------------------


def world(name, top, deep, duration):
    """Noise and drift of a world: sizes in shares of the largest force and depth."""
    noises = {
        "white": ul.Noise(force=0.005 * top),
        "proportional": ul.Noise(force=0.0005 * top, relative=0.02),
        "correlated": ul.Noise(force=0.005 * top, correlation_time=0.03 * duration),
        "depth": ul.Noise(force=0.0005 * top, depth=0.003 * deep),
        "drifting": ul.Noise(force=0.003 * top),
    }
    drift = 0.02 * top / duration if name == "drifting" else 0.0
    return noises[name], ul.Disturbances(drift=drift)


WORLDS = ("white", "proportional", "correlated", "depth", "drifting")


@dataclass(frozen=True, kw_only=True)
class StrainedLaw(ul.ContactLaw):
    """The linear law times what finite elements of a neo-Hookean layer give over it."""

    linear: ul.ContactLaw
    excess: tuple[float, ...]
    thickness: float

    @property
    def _beyond(self):
        return "the finite elements end there"

    def _force(self, depth):
        return self.linear.force(depth) * (1.0 + np.polyval((*self.excess, 0.0), depth / self.thickness))

    def _contact_radius(self, depth):
        return self.linear.contact_radius(depth)

    def _stiffness(self, depth):
        x = depth / self.thickness
        factor, slope = np.polyval((*self.excess, 0.0), x), np.polyval(np.polyder((*self.excess, 0.0)), x)
        return (
            self.linear.stiffness(depth) * (1.0 + factor) + self.linear.force(depth) * slope / self.thickness
        )


@dataclass(frozen=True)
class Strained(ul.Solver):
    """Builds it from finite_elements.csv: the excess is a cubic in w/h that vanishes with it."""

    def build(self, contact, max_depth):
        depth, force = finite_element_curve(0.3, "neo-Hookean", "none")
        bare = ul.contact_law(ul.Sphere(1.0), ul.Layer(ul.Isotropic(1.0, 0.3), 1.0), ul.RIGID, max_depth=0.3)
        powers = np.stack([depth**3, depth**2, depth], axis=1)
        # Few elements are in contact at first: those points count less.
        found = np.linalg.lstsq(
            powers * depth[:, None], depth * (force / bare.force(depth) - 1.0), rcond=None
        )[0]
        return StrainedLaw(
            method="finite elements",
            reason="the benchmark's truth",
            max_depth=max_depth,
            error_estimate=0.01,
            linear=ul.Exact(rtol=1e-10).build(contact, max_depth),
            excess=tuple(float(value) for value in found),
            thickness=contact.thickness,
        )


def finite_element_curve(nu, material, friction):
    """Depths over h and forces over E h^2 of a curve in finite_elements.csv."""
    rows = [
        row
        for row in table((FOLDER / "finite_elements.csv").read_text(encoding="utf-8"))
        if (float(row["nu"]), row["material"], row["friction"]) == (nu, material, friction)
    ]
    return np.array([float(row["w/h"]) for row in rows]), np.array([float(row["P/(E h^2)"]) for row in rows])


def table(text):
    """Rows of a CSV under its comments."""
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


def made_curve(name, noise, seed):
    """One curve, and its truth: readings begin anywhere, as an instrument's do."""
    kind = KINDS[name]
    rng = np.random.default_rng(seed)
    since_contact, time = kind.motion
    deep = float(since_contact.max())
    solver = Strained() if name == "finite_strain" else ul.Exact(rtol=1e-10)
    top = float(np.abs(kind.scene.force(since_contact, time, solver=solver)).max())
    instrument = ul.Instrument(
        contact_depth=float(rng.uniform(-0.2, 0.2) * deep), baseline=float(rng.uniform(-0.05, 0.05) * top)
    )
    modulus = kind.scene.parameters["layer.E"] * float(rng.uniform(0.8, 1.25))
    scene = replace(kind.scene, instrument=instrument).with_values({"layer.E": modulus})
    model, others = world(noise, top, deep, float(time[-1]))
    curve = ul.synthesize(
        scene,
        since_contact + instrument.contact_depth,
        model,
        seed,
        time=time,
        disturbances=others,
        solver=solver,
    )
    return curve, modulus


# --- the files -------------------------------------------------------------------------------------------


def seeds():
    """Every curve with its seed."""
    return {
        (name, noise): 1000 + 10 * i + j for i, name in enumerate(KINDS) for j, noise in enumerate(WORLDS)
    }


def make(folder: Path = FOLDER) -> None:
    """Write every file but that of the finite elements."""
    folder.mkdir(exist_ok=True)
    truths = []
    for (name, noise), seed in seeds().items():
        curve, modulus = made_curve(name, noise, seed)
        lines = [
            f"# {MADE}; a curve of {name}.toml, {noise} noise, seed {seed}",
            "time (s),depth (m),force (N)",
        ]
        lines += [
            f"{t:.7g},{w:.7g},{P:.7g}" for t, w, P in zip(curve.time, curve.depth, curve.force, strict=True)
        ]
        (folder / f"{name}.{noise}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        truths.append(
            {"curve": f"{name}.{noise}.csv", "kind": name, "noise": noise, "E (Pa)": f"{modulus:.12g}"}
        )
    write_table(folder / "truth.csv", truths)
    for name, kind in KINDS.items():
        (folder / f"{name}.toml").write_text(scene_file(name, kind), encoding="utf-8")
    write_table(folder / "contact_references.csv", contact_references())


def scene_file(name: str, kind: Kind) -> str:
    """What a user is told: the test without the truth."""
    told = kind.scene.with_values(kind.starts)
    with_file = io.StringIO()
    scratch = told.save(FOLDER / f".{name}.toml")
    text = scratch.read_text(encoding="utf-8")
    scratch.unlink()
    with_file.write(f"# {MADE}\n# {kind.about}.\n{text.strip()}\n\n")
    if kind.segment != "loading":
        with_file.write(f'[curve]\nsegment = "{kind.segment}"\n\n')
    with_file.write(f"[fit]\n{kind.fit}")
    return with_file.getvalue()


def contact_references() -> list[dict[str, str]]:
    """The stored answers in twenty digits, as a table: one row for each pair, shape and contact radius.

    Left out are tips whose contact folds (a cone on a layer a thousand times stiffer than its base): there several
    radii belong to one depth.
    """
    rows = []
    every = json.loads(STORED.read_text(encoding="utf-8"))
    for stored in every:
        layer, base = MATERIALS[stored["materials"]]
        names = ("E", "nu") if len(layer) == 2 else ("E", "E_axial", "nu", "nu_axial", "G_axial")
        about = {
            "materials": stored["materials"],
            "layer": written(names, layer),
            "base": "rigid" if base is None else written(names, base),
            "a/h": f"{stored['eps']:g}",
        }
        rows.append({**about, "shape": "flat punch", "w/H(a)": "", "P/(4 theta a H(a))": stored["kappa_inf"]})
        for exponent in EXPONENTS:
            if folds(every, stored["materials"], exponent):
                continue
            depth, force = stored[f"lambda={exponent}"]
            rows.append({**about, "shape": f"r^{exponent:g}", "w/H(a)": depth, "P/(4 theta a H(a))": force})
    return rows


def folds(stored: list[dict], materials: str, exponent: float) -> bool:
    """Whether a larger contact belongs to a smaller depth somewhere."""
    own = [row for row in stored if row["materials"] == materials]
    depths = [float(row[f"lambda={exponent}"][0]) * row["eps"] ** exponent for row in own]
    return depths != sorted(depths)


def written(names: Iterable[str], values: Iterable[float]) -> str:
    """Constants of a material in a cell."""
    return " ".join(f"{name}={value:g}" for name, value in zip(names, values, strict=True))


def write_table(path: Path, rows: list[dict[str, str]], made: str = MADE) -> None:
    """Write rows under a line that says how they were made."""
    text = io.StringIO()
    writer = csv.DictWriter(text, rows[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    path.write_text(f"# {made}\n{text.getvalue()}", encoding="utf-8")


# --- finite elements -------------------------------------------------------------------------------------

ELEMENTS, STEPS, DEEPEST = 24, 30, 0.3


def finite_elements() -> None:
    """A true sphere on a layer as thick as its radius, bonded to a rigid base."""
    rows: list[dict[str, str]] = []
    for nu in (0.3, 0.49):
        for material in ("linear", "neo-Hookean"):
            for friction in ("none", "stuck"):
                rows += finite_element_rows(nu, material, friction, ELEMENTS)
                write_table(
                    FOLDER / "finite_elements.csv",
                    rows,
                    f"made by: python tests/studies/benchmark.py finite_elements; {ELEMENTS} elements of eight "
                    f"nodes under the contact, {STEPS} steps, a true sphere of radius h",
                )


def finite_element_rows(nu, material, friction, elements, steps=STEPS, deepest=DEEPEST):
    """One curve, as rows of the table."""
    law = ul.contact_law(
        ul.Sphere(1.0), ul.Layer(ul.Isotropic(1.0, nu), 1.0), ul.RIGID, max_depth=deepest, friction=friction
    )
    press = Press(
        Tip(1.0, sphere=True),
        Layer(nu, width=6.0, finite=material != "linear"),
        float(law.contact_radius(deepest)),
        elements,
        stuck=friction == "stuck",
    )
    found = press.load(np.linspace(0.0, deepest, steps + 1)[1:])
    print(nu, material, friction, np.round(found.force / law.force(found.depth) - 1.0, 4), flush=True)
    return [
        {
            "nu": f"{nu:g}",
            "material": material,
            "friction": friction,
            "w/h": f"{w:.6g}",
            "P/(E h^2)": f"{P:.8g}",
        }
        for w, P in zip(found.depth, found.force, strict=True)
    ]


# --- the score table -------------------------------------------------------------------------------------

START, END = "<!-- benchmark:start -->", "<!-- benchmark:end -->"
#: What is scored, by its label.
PUBLISHED = ("dimitriadis2002", "garcia2018", "long2011", "hermanowicz2021")


def nanite_estimate(model_key: str):
    """Return how a user of nanite gets a modulus with one of its models; None where nanite is not installed."""
    try:
        import nanite  # noqa: PLC0415  it may be missing
        from nanite import model  # noqa: PLC0415  it may be missing
    except ImportError:
        return None
    if model_key == "underlay_layer":
        model.load_model_from_file(
            ROOT / "data_samples" / "nanite" / "model_underlay_layer.py", register=True
        )

    def estimate(case):
        scene, curve = ul.load_scene(case.scene), ul.read(case.curve)
        if scene.memory is not None:
            curve = curve.loading()
        way = slice(None, None, -1) if curve.depth[0] > curve.depth[-1] else slice(None)
        test = indentation(nanite, curve.depth[way], curve.force[way], str(case.curve))
        initial = test.get_initial_fit_parameters(model_key=model_key)
        initial["R"].value, initial["nu"].value = scene.indenter.radius, scene.layer.material.nu
        if "thickness" in initial:
            initial["thickness"].value = scene.layer.thickness
        # The contact weight of nanite's default, 1 um, is meant for cells.
        test.fit_model(model_key=model_key, params_initial=initial, preprocessing=[], weight_cp=0)
        return test.fit_properties["params_fitted"]["E"].value

    return estimate


def ways():
    """Everything that is scored: label, and what `ul.benchmark` takes."""
    yield "underlay, whole model", {}
    yield "underlay, exact law alone", {"solver": "exact"}
    yield "Hertz (half-space)", {"solver": "halfspace"}
    for name in PUBLISHED:
        yield name, {"solver": name}
    for key, label in (
        ("hertz_para", "nanite, Hertz"),
        ("underlay_layer", "nanite, our model file"),
    ):
        estimate = nanite_estimate(key)
        if estimate is not None:
            yield label, {"estimate": estimate}


def score() -> None:
    """Score everything there is, keep it, and write the table into its page."""
    rows = []
    for label, asked in ways():
        found = ul.benchmark(**asked).to_frame()
        rows += [
            {
                "way": label,
                "kind": row["kind"],
                "noise": row["noise"],
                "error (%)": f"{row['error (%)']:.7g}",
                "holds": ""
                if np.isnan(row["low (Pa)"])
                else int(row["low (Pa)"] <= row["truth (Pa)"] <= row["high (Pa)"]),
            }
            for row in found.to_dict("records")
        ]
        print(label, len(rows), flush=True)
    write_table(RESULTS, rows, "made by: python tests/studies/benchmark.py score")
    before, rest = PAGE.read_text(encoding="utf-8").split(START)
    PAGE.write_text(f"{before}{START}\n{score_table()}\n{END}{rest.split(END)[1]}", encoding="utf-8")


def score_table() -> str:
    """The stored scores as the page prints them."""
    rows = table(RESULTS.read_text(encoding="utf-8"))
    kinds = list(dict.fromkeys(row["kind"] for row in rows))
    lines = [
        f"| Error of the modulus, %: median (largest) | {' | '.join(kind.replace('_', ' ') for kind in kinds)} |",
        "|---" + "|---:" * len(kinds) + "|",
    ]
    for way in dict.fromkeys(row["way"] for row in rows):
        cells = []
        for kind in kinds:
            own = [row for row in rows if (row["way"], row["kind"]) == (way, kind)]
            sizes = [abs(float(row["error (%)"])) for row in own if row["error (%)"] != "nan"]
            cells.append(
                f"{short(np.median(sizes))} ({short(max(sizes))})" if len(sizes) == len(own) else "-"
            )
        lines.append(f"| {way} | {' | '.join(cells)} |")
    held = [row for row in rows if row["holds"]]
    lines.append(
        f"\nOf the intervals of the whole model {sum(row['holds'] == '1' for row in held)} of {len(held)} hold the "
        "truth (95 % are asked for). A dash: the law does not take that sample."
    )
    return "\n".join(lines)


def short(size: float) -> str:
    """Two digits, and no power of ten."""
    return f"{size:.0f}" if size >= 10.0 else f"{size:.2g}"


def main(words: list[str]) -> None:
    """Do what the first word says."""
    if words[:1] == ["make"]:
        make(*map(Path, words[1:2]))
    elif words == ["finite_elements"]:
        finite_elements()
    elif words == ["score"]:
        score()
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
