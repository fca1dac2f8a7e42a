"""The finite elements of the studies, on a coarse mesh: a layer that our law knows."""

import numpy as np
import pytest

import underlay as ul
from support.finite_elements import Layer, Press, Tip


@pytest.mark.parametrize("stuck", [False, True])
def test_a_layer_is_the_one_of_our_law(stuck):
    """On six elements under the contact: 1 % (0.05 to 0.1 % on twelve)."""
    layer = ul.Layer(ul.Isotropic(1.0, 0.45), 1.0)
    law = ul.contact_law(
        ul.Paraboloid(10.0), layer, ul.RIGID, max_depth=0.06, friction="stuck" if stuck else "none"
    )
    depth = np.linspace(0.0, 0.06, 7)[1:]
    wide = float(law.contact_radius(0.06))
    found = Press(Tip(10.0, sphere=False), Layer(0.45, width=5.0), wide, 6, stuck=stuck).load(depth)
    assert found.force[-1] == pytest.approx(law.force(0.06), rel=0.01)
