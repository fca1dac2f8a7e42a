"""Tables of scenes: the numbers of each, and the effects that it includes or leaves out."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from underlay.mechanics.body import RIGID, Layer
from underlay.quantities import quantity_of
from underlay.report.tables import amounts, labelled_table
from underlay.units import format_quantity

if TYPE_CHECKING:
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
