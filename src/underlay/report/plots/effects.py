"""The picture of a scene's effects: how large each one is at every depth, beside the accuracy asked."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from underlay.mechanics.indenters import FlatPunch
from underlay.mechanics.solvers import AnySolver, as_solver
from underlay.report.plots.style import GREY, axes, style, unit_for
from underlay.scene.effects import effect_sizes
from underlay.scene.scene import Scene

__all__ = ["effects"]

_POINTS = 120
# Three decades of depth show where an effect sets in.
_SHALLOWEST = 1e-3


def effects(
    scene: Scene,
    max_depth: float | None = None,
    solver: AnySolver = "auto",
    *,
    title: str = "",
    ax: Axes | None = None,
) -> Axes:
    """Draw the size of each effect of a scene against depth.

    Parameters
    ----------
    scene : Scene
        The test.
    max_depth : float, optional
        Deepest point (m) since contact; by default where the contact radius on a half-space is the layer's
        thickness, or half the tip's radius where that comes first.
    solver : Solver or str, default "auto"
        Which contact law; see `contact_law`. Its tolerance, where it has one, is drawn as a line: what lies
        below it need not be simulated.
    title : str, optional
        Written above the names of the effects, e.g. which curves the scene is of.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
    """
    wanted = as_solver(solver)
    deepest = _usual_depth(scene) if max_depth is None else max_depth
    sizes = effect_sizes(scene, deepest * np.geomspace(_SHALLOWEST, 1.0, _POINTS), wanted)
    depth = sizes.pop("depth").to_numpy()
    length, unit = unit_for(depth, "length")
    with style():
        drawn = axes(ax, height=3.2)
        for name, size in sizes.items():
            if not size.any():  # nothing has no place on a logarithmic axis
                continue
            drawn.loglog(
                depth / unit, 100.0 * np.abs(size.to_numpy()), label=_label(str(name), size.iloc[-1])
            )
        if wanted.tolerance:
            drawn.axhline(100.0 * wanted.tolerance, color=GREY, ls=":", lw=1.0)
            drawn.annotate(
                f"rtol = {wanted.tolerance:g}",
                # On the right, where effects are large.
                (0.99, 100.0 * wanted.tolerance),
                xycoords=("axes fraction", "data"),
                ha="right",
                va="bottom",
                fontsize=7.0,
            )
        drawn.set_xlabel(f"depth since contact ({length})")
        drawn.set_ylabel("change of the force (%)")
        if len(sizes.columns):
            drawn.legend(
                loc="lower left",
                bbox_to_anchor=(0.0, 1.0),
                borderaxespad=0.2,
                title=title or None,
                alignment="left",
            )
    return drawn


def _label(name: str, size: float) -> str:
    return f"{name} ({100.0 * size:+.3g} %)"


def _usual_depth(scene: Scene) -> float:
    tip = scene.indenter
    if isinstance(tip, FlatPunch):
        return 0.1 * tip.radius
    reach = min(scene.layer.thickness, 0.5 * tip.max_radius)
    if not np.isfinite(reach):
        reach = float(getattr(tip, "radius", 1e-6))
    return float(tip.abel(np.array(reach)))
