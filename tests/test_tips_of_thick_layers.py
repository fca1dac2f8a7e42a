"""Laws of a sphere off the table of the flat punch where the layer is many tips thick: the tip ends first."""

import numpy as np
import pytest

import underlay as ul
from underlay.mechanics.exact.curve_family import RigidBase
from underlay.mechanics.exact.table_laws import tip_laws


@pytest.mark.parametrize("thickness", [0.5, 5.0, 60.0, 623.4, 1e5])
def test_the_table_reaches_or_declines(thickness):
    """At 623 radii the points beyond the end of the shape fell on one another."""
    body = ul.Layer(ul.Isotropic(1.0, 0.45), thickness)
    for depth in (0.01, 0.1, 0.6):
        contact = ul.Contact.of(ul.Sphere(1.0), body, ul.RIGID)
        (law,) = tip_laws([contact], RigidBase(0.45), None, [depth], 1e-6)
        if law is None:
            continue
        exact = ul.contact_law(ul.Sphere(1.0), body, ul.RIGID, max_depth=depth, solver=ul.Exact(1e-10))
        w = np.geomspace(1e-3 * depth, depth, 7)
        assert np.allclose(law.force(w), exact.force(w), rtol=1e-6, atol=0.0)
