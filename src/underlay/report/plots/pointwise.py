"""The modulus at each depth: of a fit, with the layer in the model and by the half-space formula; and of a film.

That of a film comes from its contact stiffness, with the substrate in the model and without.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from underlay._arrays import FloatArray
from underlay.inference.uncertainty.answer import NORMAL_95
from underlay.report.plots import style

if TYPE_CHECKING:
    from underlay.inference.films import StiffnessFit
    from underlay.inference.uncertainty.answer import Answer, PointwiseModulus

# Over the largest modulus; what noise throws further out is cut off.
_HEADROOM, _USUAL = 1.15, 0.95


def pointwise_modulus(
    found: PointwiseModulus, *, answer: Answer | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the modulus read from the force at each depth, and beside it that by the half-space formula.

    Parameters
    ----------
    found : PointwiseModulus
        What `pointwise_modulus` returned.
    answer : Answer, optional
        The modulus of the fit, drawn as a line in the band of its whole uncertainty. Without it the line is what
        the fit predicts at each depth.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
    """
    length, metre = style.unit_for(0.1 * found.depth, "length")
    level = float(found.apparent.expected[-1]) if answer is None else answer.value
    name, pascal = style.unit_of(level, "pressure")
    with style.panel(ax) as panel:
        band = answer is not None and not answer.is_open
        words = [("layer on substrate" if found.layered else "half-space (Hertz)", style.FIT)]
        if answer is not None and band:
            panel.axhspan(answer.low / pascal, answer.high / pascal, color=style.FIT, alpha=0.13, lw=0.0)
            panel.axhline(answer.value / pascal, color=style.FIT, lw=1.0)
            words.append(("band: uncertainty of E", style.SOFT))
        else:
            panel.plot(found.depth / metre, found.apparent.expected / pascal, color=style.FIT, lw=1.0)
        words.insert(1, (f"bars: noise, {100.0 * found.level:.3g} %", style.SOFT))
        if found.layered:
            bare = found.apparent_halfspace.modulus / pascal
            panel.plot(
                found.depth / metre, bare, "s", ms=2.6, mec="none", color=style.REFERENCE, label="half-space"
            )
            words.insert(1, ("half-space (Hertz)", style.REFERENCE))
        _bars(panel, found, metre, pascal)
        shown = _shown(found, answer if band else None, level) / pascal
        panel.set_xlim(0.0, 1.02 * found.depth[-1] / metre)
        panel.set_ylim(0.0, _HEADROOM * shown.max())
        panel.set(xlabel=f"Indentation δ ({length})", ylabel=f"Modulus E ({name})")
        # Over the axes, in two columns: inside them bars may be anywhere.
        for place, (text, colour) in enumerate(words):
            row, column = divmod(place, 2)
            spot: dict[str, Any] = {"xytext": (0.0, 3.0 + 11.0 * ((len(words) - 1) // 2 - row))}
            spot |= {"xycoords": "axes fraction", "textcoords": "offset points"}
            panel.annotate(text, (0.5 * column, 1.0), color=colour, **spot)
    return panel


def _bars(panel: Axes, found: PointwiseModulus, metre: float, pascal: float) -> None:
    """Draw the modulus at each depth, with its interval where both ends are finite."""
    own = found.apparent
    closed = np.isfinite(own.high) & (own.low > 0.0) & np.isfinite(own.modulus)
    arms = np.zeros((2, len(own.modulus)))
    arms[:, closed] = np.array([own.modulus - own.low, own.high - own.modulus])[:, closed] / pascal
    label = "layer on substrate" if found.layered else "half-space"
    how: Any = {"fmt": "o", "ms": 3.0, "mec": "none", "color": style.FIT, "elinewidth": 0.8, "label": label}
    panel.errorbar(found.depth / metre, own.modulus / pascal, arms, **how)


def _shown(found: PointwiseModulus, answer: Answer | None, level: float) -> FloatArray:
    """Return the moduli (Pa) that set the height of the picture; outliers by noise may lie beyond it."""
    curves = (found.apparent, found.apparent_halfspace) if found.layered else (found.apparent,)
    moduli = np.concatenate([curve.modulus for curve in curves])
    moduli = moduli[moduli <= np.nanquantile(moduli, _USUAL)]
    ends = [] if answer is None else [answer.low, min(answer.high, 2.0 * level)]
    return np.asarray([level, *ends, *moduli])


def film(found: StiffnessFit, *, ax: Axes | None = None) -> Axes:
    """Draw the modulus of a film from its contact stiffness at each depth, and that by the half-space formula.

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
    length, metre = style.unit_for(depth, "length")
    name, pascal = style.unit_for(bare, "pressure")
    with style.panel(ax) as panel:
        dots: dict[str, Any] = {"marker": ".", "ms": 3.0, "lw": 0.9}
        panel.plot(depth / metre, bare / pascal, **dots, color=style.REFERENCE, label="half-space formula")
        if "layer modulus" in table:
            layer = table["layer modulus"].to_numpy()
            noise = table["layer modulus noise"].to_numpy() / layer
            if np.isfinite(noise).all():
                low, high = (layer * np.exp(sign * NORMAL_95 * noise) / pascal for sign in (-1.0, 1.0))
                panel.fill_between(
                    depth / metre, low, high, color=style.FIT, alpha=0.2, lw=0.0, label="noise, 95 %"
                )
            label = "film, base in the model"
            panel.plot(depth / metre, layer / pascal, **dots, color=style.FIT, label=label)
            panel.axhline(found.values["layer.E"] / pascal, ls="--", lw=1.0, color=style.FIT, label="fit")
        panel.set_ylim(0.0)
        panel.set(xlabel=f"depth ({length})", ylabel=f"modulus ({name})")
        panel.legend(loc="best")
    return panel
