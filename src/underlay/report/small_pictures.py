"""Pictures of a few kilobytes for pages with hundreds of them: a curve, its fit, and what is left over, as SVG."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from underlay._arrays import FloatArray
from underlay.report.plots.style import unit_of

__all__ = ["Small", "small_picture"]

# Pixels: width, height of the curve, gap, height of the residuals; margins for the words.
_WIDTH, _CURVE, _GAP, _STRIP = 250, 120, 30, 34
_LEFT, _TOP, _BOTTOM = 8, 14, 16
_MOST_POINTS = 160
# Share of the contact that is drawn of the flat part before it.
_BEFORE = 0.35


class Small(NamedTuple):
    """What is drawn: readings (m, N), (n,); the fit (N), (n,), and the contact point (m) where there is a fit."""

    depth: FloatArray
    force: FloatArray
    fit: FloatArray | None = None
    contact: float = math.nan


def small_picture(curve: Small, alt: str) -> str:
    """Return one curve as an SVG element; `alt`, which must be escaped already, is what a reader hears."""
    shown = np.isfinite(curve.depth) & np.isfinite(curve.force)
    deepest = float(curve.depth[shown].max(initial=0.0))
    if math.isfinite(curve.contact):
        shown &= curve.depth >= curve.contact - _BEFORE * (deepest - curve.contact)
    if not shown.any():
        return f'<svg role="img" aria-label="{alt}: no points" width="{_WIDTH}" height="20"></svg>'
    step = max(1, int(np.count_nonzero(shown)) // _MOST_POINTS)
    index = np.flatnonzero(shown)[::step]
    depth, force = curve.depth[index], curve.force[index]
    x = _scaled(depth, _LEFT, _WIDTH - _LEFT)
    lines = [force] if curve.fit is None else [force, curve.fit[index]]
    low, high = (float(end) for end in (np.min(lines), np.max(lines)))
    y = _TOP + _CURVE - _CURVE * (np.array(lines) - low) / ((high - low) or 1.0)
    parts = [_axes(depth, force), _dots(x, y[0])]
    height = _TOP + _CURVE + _BOTTOM
    if curve.fit is not None:
        order = np.argsort(depth, kind="stable")
        parts.append(f'<path class="fit" d="{_path(x[order], y[1][order])}"/>')
        residual = force - curve.fit[index]
        largest = float(np.abs(residual).max()) or 1.0
        middle = _TOP + _CURVE + _GAP + _STRIP / 2.0
        parts.append(f'<path class="fit" d="M{_LEFT} {middle:.0f}H{_WIDTH - _LEFT}"/>')
        parts.append(_dots(x, middle - 0.5 * _STRIP * residual / largest))
        unit, newton = unit_of(largest, "force")
        parts.append(
            _word(_LEFT, middle - _STRIP / 2.0 - 2, f"residual, up to {largest / newton:.2g} {unit}")
        )
        height += _GAP + _STRIP - _BOTTOM + 8
        if math.isfinite(curve.contact):
            at = float(_scaled(np.array([depth.min(), curve.contact, depth.max()]), _LEFT, _WIDTH - _LEFT)[1])
            parts.append(f'<path class="contact" d="M{at:.1f} {_TOP}V{_TOP + _CURVE}"/>')
    return (
        f'<svg role="img" aria-label="{alt}" viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" height="{height}">'
        f"{''.join(parts)}</svg>"
    )


def _axes(depth: FloatArray, force: FloatArray) -> str:
    length, metre = unit_of(float(np.ptp(depth)), "length")
    load, newton = unit_of(float(np.abs(force).max()), "force")
    bottom = _TOP + _CURVE
    return (
        f'<path class="axis" d="M{_LEFT} {_TOP}V{bottom}H{_WIDTH - _LEFT}"/>'
        + _word(_LEFT + 3, _TOP - 3, f"{float(force.max()) / newton:.3g} {load}")
        + _word(_LEFT, bottom + 11, f"{float(depth.min()) / metre:.3g}")
        + _word(_WIDTH - _LEFT, bottom + 11, f"{float(depth.max()) / metre:.3g} {length}", end=True)
    )


def _word(x: float, y: float, text: str, *, end: bool = False) -> str:
    anchor = ' text-anchor="end"' if end else ""
    return f'<text x="{x:.0f}" y="{y:.0f}"{anchor}>{text}</text>'


def _dots(x: FloatArray, y: FloatArray) -> str:
    dots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(x, y, strict=True))
    return f'<path class="dots" d="{dots}"/>'


def _path(x: FloatArray, y: FloatArray) -> str:
    return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def _scaled(values: FloatArray, low: float, high: float) -> FloatArray:
    span = float(np.ptp(values)) or 1.0
    return np.asarray(low + (high - low) * (values - values.min()) / span)
