"""Tables of scenes: the numbers of each, and the effects that it includes or leaves out."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from underlay._version import VERSION
from underlay.inference.adhesive_numbers import adhesive_estimates
from underlay.inference.sampling.derived import kind_of_quantity
from underlay.mechanics.body import RIGID, Layer
from underlay.quantities import quantity_of
from underlay.report.labels import label
from underlay.report.screen import WORDS, interval_text
from underlay.report.tables import amounts, labelled_table
from underlay.scene.parameters import kind_of
from underlay.units import format_ends, format_quantity, human_unit

if TYPE_CHECKING:
    from underlay.inference.films import StiffnessFit
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.mechanics.solvers import AnySolver
    from underlay.scene.scene import Scene

# Numbers of a list that a table shows; more are counted.
_LISTED = 6


def scene_table(*scenes: Scene) -> pd.DataFrame:
    """Return the numbers of scenes as text, a row each: part, quantity, and a column of values per scene."""
    tables = [_scene_rows(scene) for scene in scenes]
    if len(tables) == 1:
        return tables[0]
    keyed = [table.set_index("quantity", append=True)["value"] for table in tables]
    side_by_side = pd.concat(keyed, axis=1, keys=[f"curve {n}" for n in range(1, len(keyed) + 1)])
    return side_by_side.fillna("").reset_index(level=1, names=["part", "quantity"])


def _scene_rows(scene: Scene) -> pd.DataFrame:
    rows = [_row("indenter", "shape", scene.indenter.shape), *number_rows("indenter", scene.indenter)]
    rows += _layer_rows("layer", scene.layer)
    for number, layer in enumerate(scene.layers[1:], start=2):
        rows += _layer_rows(f"layer {number}", layer)
    if scene.base == RIGID:
        bonded = scene.layer.bond == "bonded" and len(scene.layers) == 1
        rows.append(_row("substrate", "material", "rigid, bonded to the layer" if bonded else "rigid"))
    else:
        rows += number_rows("substrate", scene.base)
    rows += _model_rows("adhesion", "model", scene.adhesion) + _model_rows("history", "model", scene.history)
    ideal = [row for row in number_rows("instrument", scene.instrument) if not row["value"].startswith("0 ")]
    rows += ideal or [_row("instrument", "effects", "none")]
    return labelled_table(rows + number_rows("lever", scene.lever))


def _row(part: str, quantity: str, value: str) -> dict[str, str]:
    return {"part": part, "quantity": quantity, "value": value.replace("_", " ")}


def _model_rows(part: str, quantity: str, owner: Any) -> list[dict[str, str]]:
    """Return the name of a part's model and its numbers; no rows where `owner` is None."""
    return [] if owner is None else [_row(part, quantity, owner.model), *number_rows(part, owner)]


def _layer_rows(part: str, layer: Layer) -> list[dict[str, str]]:
    thick, bond = layer.thickness, layer.bond
    value = format_quantity(thick, "length") if math.isfinite(thick) else "infinite (a half-space)"
    rows = [*number_rows(part, layer.material), _row(part, "thickness", value)]
    for effect in ("relaxation", "stiffening"):
        rows += _model_rows(part, effect, getattr(layer, effect))
    if layer.half_width is not None:
        wide = f"{format_quantity(layer.half_width, 'length')} ({layer.shape})"
        rows.append(_row(part, "half width", wide))
    if isinstance(bond, str):
        return rows if bond == "bonded" else [*rows, _row(part, "lower face", bond)]
    return rows + number_rows(f"spring under {part}", bond)


def number_rows(part: str, owner: Any) -> list[dict[str, str]]:
    """Return the numbers of a part of a scene as rows of text: part, quantity, value.

    `owner` is the part's dataclass, such as an indenter; empty for anything else, such as a rigid base.
    """
    if not is_dataclass(owner):
        return []
    rows = []
    for field in fields(owner):
        value, known = getattr(owner, field.name), quantity_of(field)
        kind = known.kind
        name = {"E": "Young's modulus E", "nu": "Poisson's ratio"}.get(
            field.name, field.name.replace("_", " ")
        )
        if isinstance(value, float):
            text = f"{math.degrees(value):.4g} deg" if kind == "angle" else amounts([value], kind)[0]
        elif known.many and len(value) <= _LISTED:
            text = ", ".join(format_quantity(one, kind) for one in value)
        else:
            text = value if isinstance(value, str) else f"{np.size(value)} values"
        rows.append(_row(part, name, text))
    return rows


def effects_table(scene: Scene, deepest: float, solver: AnySolver = "auto") -> pd.DataFrame:
    """Return how much each effect changes the force at indentation `deepest` (m), as text; see `Scene.effects`."""
    return ledger_in_words(scene.effects(deepest, solver=solver))


def ledger_in_words(ledger: pd.DataFrame) -> pd.DataFrame:
    """Return the table that `Scene.effects` makes (size and cost of each effect) as text."""
    rows = [
        {
            "effect": str(row["effect"]),
            "changes the force by": (
                "not in this scene" if math.isnan(row["size_percent"]) else f"{row['size_percent']:+.3g} %"
            ),
            "simulated": "yes" if row["simulated"] else "no",
            "adds to the time": _added(row["cost_percent"]) if row["simulated"] else "nothing",
            "note": str(row["note"]),
        }
        for _, row in ledger.iterrows()
    ]
    return labelled_table(rows)


def _added(percent: float) -> str:
    return f"{percent:+.0f} %" if abs(percent) >= 0.5 else "less than can be measured"


# --- what follows from adhesion


# Over pi R w, on a half-space.
_HALF_SPACE = 1.5


def adhesion_frame(result: Fit) -> pd.DataFrame:
    """Return numbers that follow from the fitted adhesion of each curve, a row each; empty without adhesion.

    They are the pull-off force (force control), the pull-off depth (depth control) and the contact radius at no
    load.

    Returns
    -------
    pandas.DataFrame
        ``quantity``, ``value``, its 95 % interval ``low`` to ``high``, ``unit``, and ``curve`` where there are
        several.
    """
    rows = []
    for number in range(len(result.curves)):
        for known in adhesive_estimates(result, number):
            unit, factor = human_unit(known.value, kind_of_quantity(known.name))
            ends = {end: getattr(known, end) / factor for end in ("value", "low", "high")}
            own = {"curve": number + 1} if len(result.curves) > 1 else {}
            rows.append({"quantity": known.name, **ends, "unit": unit, **own})
    return pd.DataFrame(rows)


def adhesion_table(result: Fit, curve: int = 0) -> pd.DataFrame:
    """Return the quantities derived from one curve's fitted adhesion, one row each, as text.

    The first rows are pull-off force, pull-off depth and the contact radius at zero load, with 95 % intervals; the
    last two are depth, force and contact radius at which the tip comes off and right after it jumps into contact,
    given the compliance of the instrument. `curve` counts from 0.
    """
    scene = result.scenes[curve]
    rows = []
    for known in adhesive_estimates(result, curve):
        kind = kind_of_quantity(known.name)
        value = interval_text(known.value, known.low, known.high, kind)
        rows.append(
            {"quantity": label(known.name), "value (95 % interval)": value, "of": WORDS["held"][known.name]}
        )
    law = scene.contact_law(0.0, solver=result.solver)
    compliance = scene.instrument.compliance
    for words, state in (
        ("the tip comes off", law.pull_off(compliance)),
        ("after the first touch", law.jump_in(compliance)),
    ):
        rows.append(
            {
                "quantity": words,
                "value (95 % interval)": (
                    f"at {format_quantity(state.depth, 'length')} under {format_quantity(state.force, 'force')}, "
                    f"contact radius {format_quantity(state.radius, 'length')}"
                ),
                "of": "this instrument" if compliance else "a stiff instrument",
            }
        )
    return labelled_table(rows)


def halfspace_of(result: Fit, curve: int = 0) -> str:
    """Return `halfspace_sentence` for one curve's fitted pull-off force; empty without adhesion.

    `curve` counts from 0.
    """
    force = next((known.value for known in adhesive_estimates(result, curve)), math.nan)
    path = "adhesion.work"
    own = next((name for name in (path, f"{path}[{curve}]") if name in result.names), "")
    stated = {path: result.interval(own).value} if own else {}
    return halfspace_sentence(result.scenes[curve].with_values(stated), force)


def halfspace_sentence(scene: Scene, pull_off_force: float) -> str:
    """Say what work of adhesion w the half-space (JKR) formula 3/2 pi R w gives for a pull-off force (N).

    The sentence compares it with the work of adhesion in `scene`, where the layer is in the model; R is the radius
    of the tip. Empty for a scene without a substrate, for a tip that is neither paraboloid nor sphere, and for
    adhesion models other than JKR.
    """
    rounded = scene.indenter.shape in ("paraboloid", "sphere") and scene.substrate is not None
    if not rounded or scene.adhesion is None or scene.adhesion.model != "jkr":
        return ""
    radius = scene.parameters["indenter.radius"]
    read, work = pull_off_force / (_HALF_SPACE * math.pi * radius), scene.parameters["adhesion.work"]
    return (
        f"Read from this pull-off force as 3/2 pi R w, which holds on a half-space, the work of adhesion would be "
        f"{format_quantity(read, 'surface energy')}: {100.0 * (read / work - 1.0):+.2g} % against "
        f"the {format_quantity(work, 'surface energy')} found on this layer."
    )


# --- films


def film_table(found: StiffnessFit) -> pd.DataFrame:
    """Return a row for each fitted number, as text: value, 95 % interval, change for 1 % more contact area."""
    rows = []
    for name, value in found.values.items():
        low, high, kind = found.low[name], found.high[name], kind_of(name)
        ends = " to ".join(format_ends(low, high, kind)) if math.isfinite(high) else "no scatter in the file"
        rows.append(
            {
                "parameter": name,
                "value": format_quantity(value, kind),
                "95 % interval (a test as a whole)": ends,
                "1 % more area": f"{found.area_sensitivity[name]:+.2f} %",
            }
        )
    return pd.DataFrame(rows)


def film_moduli(found: StiffnessFit) -> pd.DataFrame:
    """Return a row for each fitted number, as numbers.

    Returns
    -------
    pandas.DataFrame
        ``parameter``, ``value``, its 95 % interval ``low`` to ``high`` (infinite where the file states no scatter),
        ``unit``, ``1 % more area (%)`` (change of the value for 1 % more contact area), ``left of the trend (%)``
        (scatter about the fitted trend with depth), ``fitted from (m)``, ``fitted to (m)``, ``depths`` (their
        number), ``curve`` and ``underlay`` (version).
    """
    rows = []
    for name, value in found.values.items():
        unit, factor = human_unit(value, kind_of(name))
        rows.append(
            {
                "parameter": name,
                "value": value / factor,
                "low": found.low[name] / factor,
                "high": found.high[name] / factor,
                "unit": unit,
                "1 % more area (%)": found.area_sensitivity[name],
                "left of the trend (%)": 100.0 * found.scatter,
                "fitted from (m)": float(found.table["depth"].min()),
                "fitted to (m)": float(found.table["depth"].max()),
                "depths": len(found.table),
                "curve": found.table.attrs["curve"],
                "underlay": VERSION,
            }
        )
    return pd.DataFrame(rows)


def film_notes(found: StiffnessFit, *, perfect: bool) -> list[str]:
    """Return sentences on the scatter about the fitted trend with depth and, for a `perfect` cone, on its bias.

    A real tip is blunter than the perfect cone, so the modulus found with it is too large.
    """
    left = f"left of the trend with depth: {100.0 * found.scatter:.1f} % over {len(found.table)} depths"
    worn = (
        "the tip is taken as a perfect cone; a worn one is blunter, which makes the modulus too large: add a "
        "test of a known sample with the same tip"
    )
    return [left, worn] if perfect else [left]
