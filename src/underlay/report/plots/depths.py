"""Against depth: the modulus of a fit and of a film, with and without the substrate; an adhesive contact's states.

A film's modulus comes from its contact stiffness.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.uncertainty.answer import NORMAL_95
from underlay.report.plots import style

if TYPE_CHECKING:
    from underlay.inference.films import StiffnessFit
    from underlay.inference.least_squares.fit_result import Fit
    from underlay.inference.uncertainty.answer import Answer, PointwiseModulus
    from underlay.mechanics.contact_law import ContactLaw
    from underlay.mechanics.solvers import AnySolver
    from underlay.scene.scene import Scene

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


# --- an adhesive contact


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
    if not scene.adheres:
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
