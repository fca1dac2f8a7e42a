"""One curve through every door: what each place says of its numbers, digit by digit."""

import contextlib
import csv
import html
import io
import json
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

import underlay as ul
from support.user_scenes import user_test
from support.worlds import NOISES, Clean, world_curves
from underlay.app.folder import AnalysisFolder
from underlay.app.tasks import Analyst
from underlay.cli.app import main
from underlay.data.export import curve_csv
from underlay.quantities import kind_of
from underlay.report.screen import answer_text
from underlay.units import unit_factor

E, H, BASE = "layer.E", "layer.thickness", "substrate.E"
CONTACT, BASELINE = "instrument.contact_depth", "instrument.baseline"
ENDS = ("low", "high", "stat.low", "stat.high", "syst.low", "syst.high")
KINDS = {"E": (E,), "E, h": (E, H), "E, h, E2": (E, H, BASE), "disturbed": (E,)}


@dataclass(frozen=True)
class Written:
    """A made test as a user has it: the files of a curve and of a scene, and what is asked."""

    curve: Path
    scene: Path
    names: tuple[str, ...]

    @classmethod
    def of(cls, kind, seed, folder):
        names, rng = KINDS[kind], np.random.default_rng([seed, list(KINDS).index(kind)])
        drawn = iter(lambda: user_test(rng), None)
        _name, scene, deep, points, noise = next(
            one for one in drawn if BASE not in names or one[0] in {"soft base", "film"}
        )
        clean = Clean.of(scene, deep, min(points, 400))
        force = clean.force + noise * clean.top * rng.standard_normal(len(clean.depth))
        curve = ul.Curve(clean.depth, force, time=clean.time)
        if kind == "disturbed":
            curve, _ = world_curves(clean, list(NOISES)[seed % len(NOISES)], rng)
        (folder / "curves").mkdir()
        written = cls(folder / "curves" / "curve.csv", folder / "scene.toml", names)
        written.curve.write_text(curve_csv(curve), encoding="utf-8")
        written.scene.write_text(_scene_text(scene, names, deep, clean.top), encoding="utf-8")
        return written

    def said(self, folder):
        """The fit, and its numbers by place: value and ends of the interval and both parts, infinite where open."""
        problem = ul.load_problem(self.curve, self.scene)
        fit = ul.fit(problem)
        words = "--scene", self.scene, "--output"
        out = folder / "out"
        printed = _called("fit", self.curve, *words, out, "--excel", folder / "fit.xlsx")
        _called("map", self.curve.parent, *words, folder / "map", "--workers", "0")
        _called("report", self.curve, *words, folder / "page.html")
        with next((folder / "map").glob("*.csv")).open(newline="", encoding="utf-8") as table:
            row = next(csv.DictReader(line for line in table if not line.startswith("#")))
        sheet = pd.read_excel(folder / "fit.xlsx", sheet_name="results").set_index("parameter")
        kept = json.loads(next(out.glob("*.fit.json")).read_text(encoding="utf-8"))["answers"]
        analysis = AnalysisFolder(folder / "analysis")
        analysis.add_curve("curve.csv", self.curve.read_bytes())
        analysis.write_scene(self.scene.read_text(encoding="utf-8"))
        shown = Analyst(str(analysis.path)).fit(lambda _value: None)
        found = {place: {} for place in ("fit", "map", "JSON", "Excel", "page")}
        for name in self.names:
            known = fit.answer(name)
            found["fit"][name] = (
                known.value,
                known.low,
                known.high,
                *_both(known.statistical),
                *_both(known.systematic),
            )
            found["map"][name] = _ends(row[name], *(row[f"{name}.{end}"] for end in ENDS))
            own = kept[name] | {f"stat.{end}": kept[name]["statistical"][end] for end in ("low", "high")}
            own |= {f"syst.{end}": kept[name]["systematic"][end] for end in ("low", "high")}
            found["JSON"][name] = _ends(own["value"], *(own[end] for end in ENDS))
            factor = unit_factor(sheet.loc[name, "unit"], kind_of(name))
            cells = (sheet.loc[name, end.replace(".", " ")] for end in ENDS)
            found["Excel"][name] = tuple(factor * end for end in _ends(sheet.loc[name, "value"], *cells))
            # The page keeps what it prints: value, ends and statistical ends.
            found["page"][name] = (*_ends(*shown.values[name][:5]), *found["fit"][name][5:])
        words = {"map": row["verdict"], "Excel": sheet["verdict"].iloc[0], "screen": printed}
        assert [place for place, word in words.items() if fit.verdict.word not in word] == []
        texts = {"screen": printed, "report": _plain((folder / "page.html").read_text(encoding="utf-8"))}
        for place, text in texts.items():
            found[place] = {
                name: answer_text(fit.answer(name), parts=False).split(" (")[0] in text for name in self.names
            }
        return fit, found


def _both(part):
    return part.low, part.high


def _ends(value, *ends):
    """Numbers of a table or a document, in which an open end may be empty: lower and upper ends in turn."""
    known = [float("nan" if end in {None, "", "open"} else end) for end in ends]
    return float(value), *(
        (np.inf if n % 2 else -np.inf) if np.isnan(end) else end for n, end in enumerate(known)
    )


def differences(found):
    """The places, and names, that say another number than the fit, or not the line that the screen has.

    Excel keeps numbers in the units that people read: two roundings.
    """
    off = []
    for name, known in found["fit"].items():
        off += [(place, name) for place in ("map", "JSON", "page") if found[place][name] != known]
        off += [("Excel", name)] * (not np.allclose(found["Excel"][name], known, rtol=1e-15, atol=0.0))
        off += [(place, name) for place in ("screen", "report") if not found[place][name]]
    return off


def from_draws(fit, posterior):
    """How far closed ends of the statistical parts of a posterior are from the fit's, over the draws' errors.

    These are in standard deviations of the draws, in scaled coordinates. The fit has ends from as many draws or
    more: a difference has twice the variance.
    """
    off = []
    for index, (name, one) in enumerate(zip(fit.names, fit.problem.coordinates, strict=True)):
        ours, theirs = fit.answer(name).statistical, posterior.answer(name).statistical
        errors = posterior.diagnostics.quantile_errors[name]
        deviation = np.std([one.scaled(float(value)) for value in posterior.chain[..., index].ravel()])
        for own, other, error in ((ours.low, theirs.low, errors[0]), (ours.high, theirs.high, errors[-1])):
            if np.isfinite(own) and np.isfinite(other) and deviation > 0.0:
                apart = one.scaled(other) - one.scaled(own)
                off.append(apart / (deviation * error * np.sqrt(2.0)))
    return off


def _called(*words):
    """What the command line prints."""
    told, before = io.StringIO(), sys.argv
    sys.argv = ["underlay", *map(str, words)]
    try:
        with contextlib.redirect_stdout(told), contextlib.suppress(SystemExit):
            main()
    finally:
        sys.argv = before
    return " ".join(told.getvalue().split())


def _plain(page):
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", page)).split())


def _scene_text(scene, names, deep, peak):
    layer, base = scene.layer, scene.substrate

    def pascals(value):
        return f'"{value!r} Pa"'

    rows = [f"[indenter]\nshape = 'sphere'\nradius = '{scene.indenter.radius!r} m'"]
    rows.append(
        f"[layer]\nE = {pascals(layer.material.E)}\nnu = {layer.material.nu!r}\nthickness = '{layer.thickness!r} m'"
    )
    rows.append(
        "[substrate]\nrigid = true"
        if base == ul.RIGID
        else f"[substrate]\nE = {pascals(base.E)}\nnu = {base.nu!r}"
    )
    rows.append('[curve]\nfile = "curves/curve.csv"\n[fit]')
    wide = {E: 1e2, H: 5.0, BASE: 1e2}
    for name in names:
        value = scene.parameters[name]
        unit = "m" if name == H else "Pa"
        rows.append(
            f'{name} = {{ min = "{value / wide[name]!r} {unit}", max = "{value * wide[name]!r} {unit}" }}'
        )
    rows.append(f'{CONTACT} = {{ min = "{-0.4 * deep!r} m", max = "{0.4 * deep!r} m" }}')
    rows.append(f'{BASELINE} = {{ prior = "normal", mean = "0 N", sd = "{peak!r} N" }}')
    return "\n".join(rows) + "\n"
