"""The modulus depth by depth, of a fit and of a film.

The picture of the modulus depth by depth: with the layer in the model and without, and what is expected.

The picture of a film: its modulus depth by depth, with the base in the model and without.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from underlay._arrays import FloatArray
from underlay.report.plots.style import FIT, PAGE, REFERENCE, axes, style, unit_for

if TYPE_CHECKING:
    from underlay.inference.films import StiffnessFit
    from underlay.inference.pointwise.modulus import ModulusCurve, PointwiseModulus

__all__ = ["film", "pointwise_modulus"]

# Over the largest modulus of a panel; what noise throws further out is cut off.
_HEADROOM, _USUAL = 1.25, 0.9


def pointwise_modulus(found: PointwiseModulus, *, ax: Axes | None = None) -> Axes:
    """Draw the modulus that explains each depth by itself, with its interval.

    Dashed lines are what would be seen if the fitted model were right: the modulus of the fit with the layer in the
    model, and the rise (or fall) that the substrate makes of it for the formula of a half-space.

    Parameters
    ----------
    found : PointwiseModulus
        What `pointwise_modulus` returned.
    ax : matplotlib Axes, optional
        Where to draw the apparent modulus alone; without it the incremental one stands beside it.

    Returns
    -------
    matplotlib Axes
        Of the apparent modulus.
    """
    length, metre = unit_for(found.depth, "length")
    name, pascal = unit_for(_shown(found), "pressure")
    with style():
        panels = (
            [ax]
            if ax is not None
            else list(plt.subplots(1, 2, figsize=(PAGE, 2.8), sharey=True, layout="constrained")[1])
        )
        pairs = (
            (found.apparent, found.apparent_halfspace, "from the force (apparent)"),
            (found.incremental, found.incremental_halfspace, "from its slope (incremental)"),
        )
        for panel, (layer, bare, title) in zip(panels, pairs, strict=False):
            if found.layered:
                _draw(panel, found, bare, REFERENCE, "half-space formula", metre, pascal)
            _draw(
                panel,
                found,
                layer,
                FIT,
                "layer and substrate" if found.layered else "half-space",
                metre,
                pascal,
            )
            panel.set_title(title)
            panel.set_xlabel(f"depth ({length})")
            panel.set_xlim(0.0, 1.02 * found.depth[-1] / metre)
            panel.set_ylim(0.0, _HEADROOM * float(np.nanmax(_shown(found))) / pascal)
        panels[0].set_ylabel(f"modulus at this depth ({name})")
        panels[0].plot([], [], "--", color="0.4", lw=1.0, label="were the model right")
        panels[0].fill_between([], [], color="0.4", alpha=0.2, lw=0.0, label=f"{100.0 * found.level:.3g} %")
        panels[0].legend(loc="best")
    first: Axes = panels[0]
    return first


def _shown(found: PointwiseModulus) -> FloatArray:
    """Every modulus that sets the height of the picture (Pa)."""
    lines = [found.apparent.modulus, found.apparent.expected]
    if found.layered:
        lines += [found.apparent_halfspace.modulus, found.incremental_halfspace.expected]
    slopes = (found.incremental_halfspace if found.layered else found.incremental).modulus
    # A slope that noise throws far up may stand over the edge.
    return np.append(
        np.concatenate(lines), np.nanquantile(slopes, _USUAL) if np.isfinite(slopes).any() else 0.0
    )


def _draw(
    panel: Axes,
    found: PointwiseModulus,
    curve: ModulusCurve,
    color: str,
    name: str,
    metre: float,
    pascal: float,
) -> None:
    depth = found.depth / metre
    closed = np.isfinite(curve.high) & (curve.low > 0.0)
    panel.fill_between(
        depth,
        curve.low / pascal,
        curve.high / pascal,
        where=closed.tolist(),
        color=color,
        alpha=0.2,
        lw=0.0,
    )
    panel.plot(depth, curve.modulus / pascal, ".-", ms=3.0, lw=0.9, color=color, label=name)
    panel.plot(depth, curve.expected / pascal, "--", lw=1.0, color=color)


# Standard deviations to the ends of 95 %.
_WIDTH = 1.96


def film(found: StiffnessFit, *, ax: Axes | None = None) -> Axes:
    """Draw what the contact stiffness says of a film at each depth.

    Parameters
    ----------
    found : StiffnessFit
        What `fit_stiffness` returned.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
    """
    table = found.table
    depth, bare = table["depth"].to_numpy(), table["half-space modulus"].to_numpy()
    length, metre = unit_for(depth, "length")
    name, pascal = unit_for(bare, "pressure")
    with style():
        panel = axes(ax)
        panel.plot(
            depth / metre, bare / pascal, ".-", ms=3.0, lw=0.9, color=REFERENCE, label="half-space formula"
        )
        if "layer modulus" in table:
            layer = table["layer modulus"].to_numpy()
            noise = table["layer modulus noise"].to_numpy() / layer
            if np.isfinite(noise).all():
                low, high = (layer * np.exp(sign * _WIDTH * noise) / pascal for sign in (-1.0, 1.0))
                panel.fill_between(
                    depth / metre, low, high, color=FIT, alpha=0.2, lw=0.0, label="noise, 95 %"
                )
            panel.plot(
                depth / metre,
                layer / pascal,
                ".-",
                ms=3.0,
                lw=0.9,
                color=FIT,
                label="film, base in the model",
            )
            panel.axhline(found.values["layer.E"] / pascal, ls="--", lw=1.0, color=FIT, label="fit")
        panel.set_ylim(0.0)
        panel.set_xlabel(f"depth ({length})")
        panel.set_ylabel(f"modulus ({name})")
        panel.legend(loc="best")
    return panel
