"""Where the indenter first touches: three estimators, each with an uncertainty.

* ``foot``: the baseline turns into the foot of a contact law with free stiffness.
* ``change-point``: the baseline turns into a parabola with free coefficients; no contact law.
* ``threshold``: the depth of the last passage through 3 standard deviations of the noise, carried back by
  the rise that follows to where it starts.

The first two scan the contact depth and solve for the linear coefficients, so nothing has to be started or
to converge; the uncertainty is the curvature of the sum of squares, widened for correlated residuals.
Forces below the baseline right before the rise (adhesion) are left out of these fits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from underlay._given import require_given
from underlay.data.contact_scan import (
    BEFORE,
    ContactEstimate,
    Points,
    change_point,
    power_law,
    scan,
    shape_of,
    with_a_doubtful_shape,
)
from underlay.data.curve import Curve
from underlay.data.foot import SIGNIFICANT, Foot, foot_of
from underlay.errors import CurveError, InputError
from underlay.mechanics.contact_law import ContactLaw
from underlay.scene.scene import Scene
from underlay.units import format_quantity

__all__ = ["METHODS", "ContactEstimate", "ContactPoint", "contact_of", "find_contact", "reach_of"]

#: Names of the estimators, the one used by default first.
METHODS = ("foot", "change-point", "threshold")


@dataclass(frozen=True)
class ContactPoint:
    """The contact depth of a curve.

    Parameters
    ----------
    depth, uncertainty : float
        By the estimator `method` (m). The uncertainty of a foot's holds that its law may rise with another power,
        that of others the scatter of all estimators.
    method : str
        One of `METHODS`.
    estimates : tuple of ContactEstimate
        All estimators that gave one.
    baseline, baseline_slope : float
        Force in front of contact, ``baseline + baseline_slope * depth`` (N, N/m).
    noise : float
        Standard deviation of the force about the baseline (N).
    notes : tuple of str
        Reservations, such as adhesion before contact.
    """

    depth: float
    uncertainty: float
    method: str
    estimates: tuple[ContactEstimate, ...]
    baseline: float
    baseline_slope: float
    noise: float
    notes: tuple[str, ...] = ()

    @property
    def scatter(self) -> float:
        """Standard deviation (m) of all estimates: large where there is more to see than a contact."""
        return float(np.std([estimate.depth for estimate in self.estimates]))


def find_contact(
    curve: Curve, method: str = "auto", *, scene: Scene | None = None, exponent: float = 1.5
) -> ContactPoint:
    """Estimate the depth reading at which the indenter touches.

    Parameters
    ----------
    curve : Curve
        With its approach, if it has one.
    method : str
        One of `METHODS`; "auto" takes the first that gives an estimate.
    scene : Scene, optional
        Its contact law shapes the foot. Without it the foot is a power law.
    exponent : float
        Exponent of that power law: 1.5 for a ball, 2 for a cone, 1 for a flat punch.

    Returns
    -------
    ContactPoint
        The estimate with its uncertainty, and those of all estimators.

    Raises
    ------
    CurveError
        If the curve cannot be fitted, or its force never rises out of the noise.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.linspace(-2e-6, 2e-6, 401)
    >>> noise = 1e-15 * np.random.default_rng(1).standard_normal(401)
    >>> contact = find_contact(Curve(x, 1e-3 * np.clip(x - 5e-7, 0.0, None) ** 1.5 + noise))
    >>> abs(contact.depth - 5e-7) < 1e-9
    True
    """
    require_given(curve, "curve", Curve)
    if method != "auto" and method not in METHODS:
        raise InputError(f"no contact method {method!r}; there are auto, {', '.join(METHODS)}")
    if not (np.isfinite(exponent) and 0.5 <= exponent <= 5.0):
        raise InputError(f"the exponent of the foot must be between 0.5 and 5; got {exponent!r}")
    foot = foot_of(curve)
    law = None if scene is None else scene.contact_law(reach_of(foot))
    return contact_of(foot, law, method, exponent=exponent)


def reach_of(foot: Foot) -> float:
    """Depth (m) that a law must reach to shape a foot."""
    return (1.0 + BEFORE) * float(np.ptp(foot.depth))


def contact_of(foot: Foot, law: ContactLaw | None, method: str = "auto", *, exponent: float) -> ContactPoint:
    """`find_contact` of a curve's foot, which a law shapes, or without one a power law.

    Raises
    ------
    CurveError
        If the method gives none.
    """
    shape = power_law(exponent) if law is None else shape_of(law)
    points = Points.of(foot)
    by_foot = scan("foot", foot, points, shape)
    tried = (
        None if by_foot is None else by_foot.estimate,
        # Without a stretch in front of contact there is no change to find.
        change_point(foot, points) if foot.has_baseline else None,
        _threshold(foot, exponent),
    )
    estimates = tuple(estimate for estimate in tried if estimate is not None)
    chosen = [estimate for estimate in estimates if method in {"auto", estimate.method}]
    if not chosen:
        raise CurveError(f"no contact found by {method}: the force does not rise as from a contact")
    contact = chosen[0]
    found = ContactPoint(
        depth=contact.depth,
        uncertainty=contact.uncertainty,
        method=contact.method,
        estimates=estimates,
        baseline=foot.baseline,
        baseline_slope=foot.baseline_slope,
        noise=foot.noise,
        notes=_notes(foot),
    )
    if by_foot is not None and contact is by_foot.estimate:
        return replace(found, uncertainty=with_a_doubtful_shape(foot, points, shape, by_foot))
    # These know nothing of a shape: they differ by what theirs do.
    return replace(found, uncertainty=float(np.hypot(contact.uncertainty, found.scatter)))


def _threshold(foot: Foot, exponent: float) -> ContactEstimate | None:
    """Depth of the passage through the threshold, less the depth a power law needs to reach it."""
    level = SIGNIFICANT * foot.noise
    x, force = foot.depth, foot.force
    if foot.rise >= len(x):
        return None
    first = float(x[foot.rise])
    if level <= 0.0:  # no noise: the passage is contact, to a sample
        before = float(x[max(foot.rise - 1, 0)])
        return ContactEstimate("threshold", before, max(first - before, np.spacing(abs(first))))
    higher = np.flatnonzero(force[foot.rise :] >= 4.0 * level)
    if not higher.size:
        return ContactEstimate("threshold", first, float(x[-1]) - first)
    gap = max(float(x[foot.rise + higher[0]]) - first, 0.0)
    pressed = gap / (4.0 ** (1.0 / exponent) - 1.0)
    # Noise moves the passage by sigma over the slope of the rise there, pressed / (3 exponent), at both
    # levels; the exponent itself (1 to 2) moves the way back by a third of the gap either way.
    scatter = np.hypot(pressed / (SIGNIFICANT * exponent) * 2.0, gap / 3.0)
    spacing = first - float(x[max(foot.rise - 1, 0)])
    return ContactEstimate("threshold", first - pressed, float(np.hypot(scatter, spacing)))


def _notes(foot: Foot) -> tuple[str, ...]:
    notes = []
    if foot.dip > 2.0 * SIGNIFICANT * foot.noise and foot.dip > 0.01 * foot.peak:
        dip = format_quantity(foot.dip, "force")
        notes.append(
            f"the force dips by {dip} before contact: a bent baseline, or adhesion: fit it with adhesion, "
            '[adhesion] with model = "jkr" in a scene file'
        )
    if not foot.has_baseline:
        notes.append("the curve has no stretch in front of contact: its baseline is assumed, not measured")
    return tuple(notes)
