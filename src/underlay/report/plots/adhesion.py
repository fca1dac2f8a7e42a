"""The picture of an adhesive contact: all its equilibrium states against depth, the stable ones, and its jumps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from underlay.errors import InputError
from underlay.report.plots import style

if TYPE_CHECKING:
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.mechanics.contact_law import ContactLaw
    from underlay.mechanics.solvers import AnySolver
    from underlay.scene.scene import Scene

# Of the pull-off force: how far the picture reaches.
_LOADS = 2.0


def adhesion(
    subject: Scene | Fit,
    *,
    curve: int = 0,
    max_depth: float | None = None,
    solver: AnySolver = "auto",
    ax: Axes | None = None,
) -> Axes:
    """Draw the equilibrium states of an adhesive contact (force against depth of the tip), and its jumps.

    Parameters
    ----------
    subject : Scene or Fit
        A scene with adhesion, or a fit of one, whose measured points are then drawn too.
    curve : int, default 0
        Which curve of a joint fit.
    max_depth : float, optional
        Largest depth (m); by default that at twice the pull-off force, or the end of the curve if that is less.
    solver : Solver or str, default "auto"
        Which contact law, for a scene.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    InputError
        If the scene has no adhesion.
    """
    fitted = hasattr(subject, "scenes")
    scene: Scene = subject.scenes[curve] if fitted else subject  # type: ignore[union-attr,assignment]
    wanted = subject.solver if fitted else solver  # type: ignore[union-attr]
    if scene.adhesion is None:
        raise InputError("nothing sticks in this scene: there is no pull-off to draw")
    measured = _measured(subject, curve) if fitted else None  # type: ignore[arg-type]
    if max_depth is None:
        max_depth = _depth_worth_drawing(scene, wanted)
        if measured is not None:
            max_depth = min(max_depth, float(measured[0].max()))
    if measured is not None:
        shown = measured[0] <= max_depth
        measured = measured[0][shown], measured[1][shown]
    law = scene.contact_law(max(max_depth, 0.0), solver=wanted)
    depth, force = law.equilibria(law.max_depth)
    length, metre = style.unit_for(depth, "length")
    load, newton = style.unit_for(force, "force")
    with style.panel(ax, height=3.0) as panel:
        panel.axhline(0.0, color=style.GREY, lw=0.6)
        panel.plot(depth / metre, force / newton, ":", color=style.DATA, lw=1.0, label="unstable")
        if measured is not None:
            panel.plot(
                measured[0] / metre, measured[1] / newton, ".", ms=2.2, color=style.DATA, label="measured"
            )
        stable = np.linspace(law.pull_off_depth, law.max_depth, style.LINE_POINTS)[1:]
        panel.plot(stable / metre, law.force(stable) / newton, color=style.FIT, label="stable, depth given")
        _jumps(panel, law, scene.instrument.compliance, metre, newton)
        panel.set(xlabel=f"depth of the tip ({length})", ylabel=f"force ({load})")
        panel.legend(loc="best")
    return panel


def _depth_worth_drawing(scene: Scene, solver: AnySolver) -> float:
    """Return the depth (m) at a load of twice the pull-off force; the law is extended until it reaches that."""
    law = scene.contact_law(0.0, solver=solver)
    load, depth = _LOADS * law.pull_off_force, max(abs(law.pull_off_depth), law.max_depth)
    while depth == 0.0 or float(law.force(law.max_depth)) < load:
        depth = 2.0 * depth or 0.1 * law.zero_load_radius
        law = scene.contact_law(depth, solver=solver)
    return float(law.depth(load))


def _measured(result: Fit, curve: int) -> tuple[np.ndarray, np.ndarray]:
    """Return depth of the tip (m) and contact force (N) of the points of a curve, thinned."""
    measured, scene = result.curves[curve], result.scenes[curve]
    instrument = scene.instrument
    force = measured.force - instrument.baseline - instrument.baseline_slope * measured.depth
    depth = measured.depth - instrument.contact_depth - instrument.compliance * force
    step = max(1, len(measured) // style.MOST_POINTS)
    return depth[::step], force[::step]


def _jumps(panel: Axes, law: ContactLaw, compliance: float, metre: float, newton: float) -> None:
    """Draw arrows for the jumps out of contact and into it.

    They are drawn for a given depth, a given load and, in between, this instrument with its `compliance` (m/N).
    `metre` and `newton` are the units of the axes in SI.
    """
    held = [("depth given", 0.0, style.REFERENCE), ("load given", np.inf, style.ACCENT)]
    if compliance:
        held.insert(1, ("this instrument", compliance, style.PURPLE))
    reach = 0.5 * (law.max_depth - law.pull_off_depth)
    for words, spring, color in held:
        off, first = law.pull_off(spring), law.jump_in(spring)
        # The travel w + C P stays while the tip jumps; under a given load it leaves for good.
        away = off.depth - reach if spring == np.inf else off.depth + spring * off.force
        rest = off.force if spring == np.inf else 0.0
        arrow = {"arrowstyle": "->", "color": color, "lw": 1.1, "shrinkA": 0.0, "shrinkB": 0.0}
        for begin, end in (((off.depth, off.force), (away, rest)), ((0.0, 0.0), (first.depth, first.force))):
            panel.annotate(
                "", (end[0] / metre, end[1] / newton), (begin[0] / metre, begin[1] / newton), arrowprops=arrow
            )
        panel.plot(off.depth / metre, off.force / newton, "o", ms=4.0, color=color, label=f"jumps, {words}")
    panel.set_xlim(left=(law.pull_off_depth - reach) / metre)
