"""The test drawn to scale at one depth, and the size of each of its effects against depth.

The drawing shows indenter, layer, substrate and contact; the effects are compared with the required accuracy.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from underlay._arrays import FloatArray
from underlay.mechanics.body import Base
from underlay.mechanics.solvers import AnySolver, as_solver
from underlay.quantities import numbers_of
from underlay.report.plots import style
from underlay.scene.effects import effect_sizes
from underlay.scene.scene import Scene

# The picture is at least this many contact radii wide on either side, and a thickness deeper than so many
# contact radii is cut off at the bottom, and said so.
_WIDTH, _DEEPEST = 2.6, 5.0
# A layer thinner than this share of the picture has no room for words.
_THIN = 0.2
# Deeper layers in turn, so that neighbours differ.
_SHADES = ("#d9e5c3", "#efd9b8")
# What is said of a lower face.
_BONDS = {"bonded": "", "slip": ",\nfree to slip", "unknown": ",\nbond unknown"}
# Inches: room for names beside the picture, the picture without it, and the least between two lines of names.
_BESIDE, _PICTURE, _LINE = 2.3, (2.8, 2.0), 0.17
_EFFECTS_POINTS = 120
# Three decades of depth show where an effect sets in.
_SHALLOWEST = 1e-3


def scene(
    test: Scene, *, depth: float, title: str = "", solver: AnySolver = "auto", ax: Axes | None = None
) -> Axes:
    """Draw a scene to scale, pressed to a depth reading.

    Parameters
    ----------
    test : Scene
        What to draw.
    depth : float
        Depth reading (m) at which it is drawn.
    title : str, optional
        Written above, e.g. which curves the scene is of.
    ax : matplotlib Axes, optional
        Where to draw.
    solver : Solver or str, default "auto"
        Solver of the contact law, which gives the contact radius; see `contact_law`.

    Returns
    -------
    matplotlib Axes
        Both axes in the same unit, the undeformed surface at height zero. The surface outside the contact is only
        sketched. Several layers are named beside the picture; a face that is not bonded is a broken line.
    """
    pressed = max(float(depth) - test.instrument.contact_depth, 0.0)
    law = test.contact_law(pressed, solver=solver)
    tip = float(test.instrument.chain.tip_depth(law, np.array([float(depth)]))[0])
    radius = float(law.contact_radius(np.array([max(tip, 0.0)]))[0])
    # Of a test that does not touch: its thickness, or else the radius of the tip.
    lengths = [one for one in (test.layer.thickness, test.indenter.max_radius) if np.isfinite(one)]
    size = radius or max(tip, 1e-3 * float((*lengths, 1e-3)[0]))
    thick = test.layer.thickness
    shown = min(thick, _DEEPEST * size)
    half = max(_WIDTH * size, 0.9 * shown)
    unit, factor = style.unit_of(max(half, shown), "length")
    with style.style():
        # The names of the layers may be too long to be written inside the picture.
        long = len(test.layers) > 1 or (test.substrate is not None and test.layer.bond != "bonded")
        beside = long and shown == thick
        ax = style.axes(ax, width=style.COLUMN + (_BESIDE if beside else 0.0), height=2.6)
        top = 0.55 * half
        deeper = sum(layer.thickness for layer in test.layers[1:])
        room = max(0.35 * half, min(1.2 * deeper, half)) if shown == thick else 0.0
        bottom = -shown - room
        ax.set(xlim=(-half / factor, half / factor), ylim=(bottom / factor, top / factor))
        ax.set_aspect("equal")
        _draw_layer(ax, test, tip, radius, half, shown, factor)
        if shown == thick:
            _draw_below(ax, test, half, bottom, factor)
        _draw_indenter(ax, test, tip, half, top, factor)
        if beside:
            ax.text(0.0, 0.9 * top / factor, test.indenter.shape.replace("_", " "), ha="center", va="top")
            _name_beside(ax, test, (half, bottom, top), factor)
        else:
            _write(ax, test, (half, shown, bottom, top), factor)
        _mark_contact(ax, test, tip, radius, factor)
        ax.set(xlabel=f"distance from the axis ({unit})", ylabel=f"height ({unit})")
        if title:
            ax.set_title(title)
    return ax


def _draw_layer(
    ax: Axes, test: Scene, tip: float, radius: float, half: float, shown: float, factor: float
) -> None:
    r = np.linspace(0.0, half, style.LINE_POINTS)
    surface = np.zeros_like(r)
    if radius > 0.0:
        inside = r <= radius
        surface[inside] = test.indenter.surface(r[inside]) - tip
        edge = float(test.indenter.surface(np.array([radius]))[0]) - tip
        # Outside the contact: the form of a flat punch on a half-space, from the edge of the contact on.
        surface[~inside] = edge * (2.0 / np.pi) * np.arcsin(radius / r[~inside])
        # A stiff film on something soft bends more widely: no sketch of it reaches into the indenter.
        under = r <= test.indenter.max_radius
        surface[under] = np.minimum(surface[under], test.indenter.surface(r[under]) - tip)
    both, height = _mirrored(r, surface)
    ax.fill_between(both / factor, -shown / factor, height / factor, color=style.LAYER, lw=0.0)
    ax.plot(both / factor, height / factor, color=style.INK, lw=0.9)


def _draw_below(ax: Axes, test: Scene, half: float, bottom: float, factor: float) -> None:
    """Draw what is under the top layer, and the lower faces of the layers: broken where they are not bonded."""
    sides = [-half / factor, half / factor]
    depth = test.layer.thickness
    ax.fill_between(sides, bottom / factor, -depth / factor, color=style.SUBSTRATE, lw=0.0)
    layers = test.layers
    for number, layer in enumerate(layers[1:]):
        lower = min(depth + layer.thickness, -bottom)
        shade = _SHADES[number % len(_SHADES)]
        ax.fill_between(sides, -lower / factor, -depth / factor, color=shade, lw=0.0)
        depth = lower
    for face, layer in zip(np.cumsum([layer.thickness for layer in layers]), layers, strict=True):
        if -face > bottom:
            ax.axhline(
                -face / factor, color=style.INK, lw=0.9, ls="-" if layer.held.bond == "bonded" else "--"
            )


def _name_beside(ax: Axes, test: Scene, window: tuple[float, float, float], factor: float) -> None:
    """Write names of layers and base to the right of the picture, each with a line to the middle of its layer."""
    half, bottom, top = window
    depth, middles, names = 0.0, [], []
    for layer in test.layers:
        middles.append(-min(depth + 0.5 * layer.thickness, 0.995 * -bottom))
        depth += layer.thickness
        bond = _BONDS.get(str(layer.bond), ",\non springs")
        names.append(f"{style.in_words(layer.thickness, 'length')}, {material_words(layer.material)}{bond}")
    middles.append(0.5 * (bottom - min(depth, -bottom)))
    names.append(material_words(test.base))
    lines = np.array([1.0 + name.count("\n") for name in names])
    inch = max(2.0 * half / _PICTURE[0], (top - bottom) / _PICTURE[1])
    places = style.apart(np.array(middles), lines * _LINE * inch, bottom)
    along = ax.get_yaxis_transform()
    line: Any = {"transform": along, "color": style.INK, "lw": 0.6, "clip_on": False}
    for name, middle, place in zip(names, middles, places.tolist(), strict=True):
        ax.plot([1.0, 1.04], [middle / factor, place / factor], **line)
        ax.text(1.05, place / factor, name, transform=along, va="center", ha="left")


def _draw_indenter(ax: Axes, test: Scene, tip: float, half: float, top: float, factor: float) -> None:
    reach = min(half, test.indenter.max_radius)
    r = np.linspace(0.0, reach, style.LINE_POINTS)
    both, height = _mirrored(r, test.indenter.surface(r) - tip)
    ax.fill_between(
        both / factor, height / factor, top / factor, where=height < top, color=style.METAL, lw=0.0
    )
    inside = height < top
    ax.plot(both[inside] / factor, height[inside] / factor, color=style.INK, lw=0.9)


def _write(ax: Axes, test: Scene, window: tuple[float, float, float, float], factor: float) -> None:
    half, shown, bottom, top = window
    left = -0.96 * half / factor
    ax.text(0.0, 0.9 * top / factor, test.indenter.shape.replace("_", " "), ha="center", va="top")
    layer = f"layer, {material_words(test.layer.material)}"
    thick = test.layer.thickness
    if shown < thick:
        below = f"goes on to {style.in_words(thick, 'length')}" if np.isfinite(thick) else "a half-space"
        ax.text(left, -0.72 * shown / factor, layer, va="center", ha="left")
        ax.text(left, -0.94 * shown / factor, below, va="center", ha="left", style="italic")
        return
    words = f"substrate, {material_words(test.base)}"
    if shown < _THIN * (top - bottom):
        # No room for words in a thin layer: they stand below it.
        words = f"{layer}, {style.in_words(thick, 'length')} thick\n{words}"
    else:
        ax.text(left, -0.72 * shown / factor, layer, va="center", ha="left")
        _write_thickness(ax, thick, 0.86 * half, factor)
    ax.text(left, 0.5 * (bottom - shown) / factor, words, va="center", ha="left")


def _mark_contact(ax: Axes, test: Scene, tip: float, radius: float, factor: float) -> None:
    if radius > 0.0:
        edge = float(test.indenter.surface(np.array([radius]))[0]) - tip
        ax.plot([-radius / factor, radius / factor], [edge / factor] * 2, "o", color=style.INK, ms=2.5)
        ax.set_title(
            f"depth {style.in_words(tip, 'length')}, contact radius {style.in_words(radius, 'length')}"
        )


def _write_thickness(ax: Axes, thick: float, x: float, factor: float) -> None:
    arrow = {"arrowstyle": "<->", "color": style.INK, "lw": 0.8}
    ax.annotate("", (x / factor, 0.0), (x / factor, -thick / factor), arrowprops=arrow)
    words = style.in_words(thick, "length")
    ax.text(0.965 * x / factor, -0.5 * thick / factor, words, ha="right", va="center")


def material_words(material: Base | None) -> str:
    """Return a material in words: ``"E = 0.617 MPa, ν = 0.46"``, or ``"rigid"``."""
    numbers = {} if material is None else numbers_of(material)
    if not numbers:
        return "rigid"
    return f"E = {style.in_words(numbers['E'].value, 'pressure')}, ν = {numbers['nu'].value:.3g}"


def _mirrored(r: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.concatenate([-r[:0:-1], r]), np.concatenate([values[:0:-1], values])


def effects(
    scene: Scene,
    max_depth: float | None = None,
    solver: AnySolver = "auto",
    *,
    title: str = "",
    ax: Axes | None = None,
) -> Axes:
    """Draw the size of each effect of a scene, in per cent of the force, against indentation.

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
    sizes = effect_sizes(scene, deepest * np.geomspace(_SHALLOWEST, 1.0, _EFFECTS_POINTS), wanted)
    depth = sizes.pop("depth").to_numpy()
    length, unit = style.unit_for(depth, "length")
    with style.panel(ax, height=3.2) as drawn:
        for name, size in sizes.items():
            if not size.any():  # nothing has no place on a logarithmic axis
                continue
            label = f"{name} ({100.0 * size.iloc[-1]:+.3g} %)"
            drawn.loglog(depth / unit, 100.0 * np.abs(size.to_numpy()), label=label)
        if wanted.tolerance:
            drawn.axhline(100.0 * wanted.tolerance, color=style.GREY, ls=":", lw=1.0)
            # On the right, where effects are large.
            how: dict[str, Any] = {"transform": drawn.get_yaxis_transform(), "ha": "right", "va": "bottom"}
            drawn.text(0.99, 100.0 * wanted.tolerance, f"rtol = {wanted.tolerance:g}", **how, fontsize=7.0)
        drawn.set(xlabel=f"depth since contact ({length})", ylabel="change of the force (%)")
        if len(sizes.columns):
            above: Any = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
            drawn.legend(**above, title=title or None, alignment="left")
    return drawn


def _usual_depth(scene: Scene) -> float:
    tip = scene.indenter
    if tip.has_edge:
        return 0.1 * tip.max_radius
    reach = min(scene.layer.thickness, 0.5 * tip.max_radius)
    if not np.isfinite(reach):
        reach = tip.curvature_radius or 1e-6
    return float(tip.abel(np.array(reach)))
