"""The error of a paraboloid that stands for a sphere.

A tip whose shape is higher by df(r) presses, at the same depth and to first order, with a force that is lower by
its mean under the pressure of a flat punch of the contact radius times the stiffness dP/dw (the contact's edge
carries no pressure, so its motion counts in second order). A sphere is higher than its paraboloid r^2 / (2 R) by
r^4 / (8 R^3), and under the punch on a half-space, p ~ (a^2 - r^2)^(-1/2), the mean of r^4 is 8 a^4 / 15:

    P_sphere - P_paraboloid = - dP/dw a^4 / (15 R^3).

Under the uniform pressure of a thin compressible layer it is a^4 / (24 R^3), under the parabola of a thin
incompressible one a^4 / (48 R^3): an amplitude of 0.3 to 1, or 0 where the tip is a paraboloid after all.
"""

from __future__ import annotations

from underlay._arrays import FloatArray
from underlay.inference.misfit.known_error import KnownError, Pressed
from underlay.mechanics.indenters import Paraboloid
from underlay.scene.scene import Scene

__all__ = ["paraboloid_for_sphere"]


def paraboloid_for_sphere(scene: Scene) -> KnownError | None:
    """Return the error of a paraboloid; none for other tips."""
    if not isinstance(scene.indenter, Paraboloid):
        return None
    return KnownError("a tip that is a sphere, not a paraboloid", _column)


def _column(test: Pressed) -> FloatArray:
    a = test.law.contact_radius(test.depth)
    return -test.stiffness * a**4 / (15.0 * test.values["indenter.radius"] ** 3)
