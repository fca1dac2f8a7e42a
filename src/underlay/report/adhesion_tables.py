"""Tables and sentences on an adhesive contact: pull-off, jumps, and the comparison with the half-space formula."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pandas as pd

from underlay.inference.reported import adhesive_estimates
from underlay.inference.sampling.derived import kind_of_quantity
from underlay.report.labels import label
from underlay.report.screen import interval_text
from underlay.report.tables import labelled_table
from underlay.units import format_quantity, human_unit

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.scene.scene import Scene

# Over pi R w, on a half-space.
_HALF_SPACE = 1.5
_HELD = {
    "adhesion.pull_off_force": "a given load",
    "adhesion.pull_off_depth": "a given depth",
    "adhesion.zero_load_radius": "no load",
}


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
        rows.append({"quantity": label(known.name), "value (95 % interval)": value, "of": _HELD[known.name]})
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
