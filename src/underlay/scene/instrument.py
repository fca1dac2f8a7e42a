"""What stands between the contact and the numbers in the file.

The instrument reads a depth d (its own zero) and a force F. The tip's depth into the sample is
w = d - contact_depth - compliance * P(w), and F = P(w) + baseline + baseline_slope * d. Each effect that
is zero runs no code.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from underlay._arrays import FloatArray, finite
from underlay.errors import InputError
from underlay.mechanics.contact_law import ContactLaw

__all__ = ["Instrument"]

# Newton from the stiff side on a convex function converges monotonically; 50 is far beyond need.
_MAX_STEPS = 50


@dataclass(frozen=True)
class Instrument:
    """Contact point, force baseline and compliance of an instrument; the default is ideal.

    Parameters
    ----------
    contact_depth : float
        Reading of the depth axis at first contact (m).
    baseline : float
        Force reading without contact at zero of the depth axis (N).
    baseline_slope : float
        Change of that reading along the depth axis (N/m).
    compliance : float
        Compliance of frame or cantilever not yet removed from the depth (m/N), zero or positive.
    """

    contact_depth: float = 0.0
    baseline: float = 0.0
    baseline_slope: float = 0.0
    compliance: float = 0.0

    def __post_init__(self) -> None:
        for field, unit in zip(fields(self), ("m", "N", "N/m", "m/N"), strict=True):
            object.__setattr__(self, field.name, finite(getattr(self, field.name), field.name, unit))
        if self.compliance < 0.0:
            raise InputError(f"instrument compliance must be zero or positive (m/N); got {self.compliance!r}")

    def tip_depth(self, law: ContactLaw, depth: FloatArray) -> FloatArray:
        """Depth of the tip into the sample (m) at instrument readings `depth` (m), same shape."""
        pressed = depth - self.contact_depth if self.contact_depth else depth
        if not self.compliance:
            return pressed
        return _share_between_sample_and_frame(law, pressed, self.compliance)

    def reading(self, depth: FloatArray, force: FloatArray) -> FloatArray:
        """Force the instrument shows (N) for contact forces `force` (N) at readings `depth` (m)."""
        if self.baseline:
            force = force + self.baseline
        if self.baseline_slope:
            force = force + self.baseline_slope * depth
        return force


def _share_between_sample_and_frame(law: ContactLaw, pressed: FloatArray, compliance: float) -> FloatArray:
    """Solve w + c P(w) = s for w, with s the travel since contact.

    P is convex in w for every law here, so Newton's method from w = s descends monotonically to the root.
    """
    w = np.array(pressed, dtype=np.float64)
    touching = w > 0.0
    s = w[touching]
    # The start must be inside the range of the law; the root is below it whenever a root exists there.
    x = np.minimum(s, law.max_depth)
    for _ in range(_MAX_STEPS):
        step = (x + compliance * law.force(x) - s) / (1.0 + compliance * law.stiffness(x))
        x = np.where(step < x, x - step, 0.5 * x)
        if (np.abs(step) <= 4.0 * np.finfo(float).eps * s).all():
            break
    w[touching] = x
    return w
