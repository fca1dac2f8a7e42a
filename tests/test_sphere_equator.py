"""A true sphere near its equator, and a tip deeper than the layer is thick: right, refused, or flagged."""

import numpy as np
import pandas as pd
import pytest

import underlay as ul
from support.maps import FREE
from underlay.mechanics.body import isotropic_constants
from underlay.mechanics.contact_law import DeeperThanLayer
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.kernel import LayerKernel

R = 1e-6
BALL = ul.Sphere(R)
# Relative error of the central difference: h^2/6 P'''/P', at most 1e-7 with steps of 1e-4 of the depth.
STEP = 1e-4


def layer(nu, thickness):
    return ul.Layer(ul.Isotropic(1e4, nu), thickness * R)


def base(ratio):
    return ul.RIGID if np.isinf(ratio) else ul.Isotropic(1e4 * ratio, 0.3)


def law_to_the_end(nu, thickness, ratio, rtol):
    """The exact law to the depth that a RangeError names, or to 9 R."""
    contact = (BALL, layer(nu, thickness), base(ratio))
    try:
        return ul.contact_law(*contact, max_depth=9.0 * R, solver=ul.Exact(rtol))
    except ul.RangeError as error:
        named = error.max_depth * (1.0 - rtol)
        return ul.contact_law(*contact, max_depth=named, solver=ul.Exact(rtol))


@pytest.mark.parametrize("nu", [0.5, 0.3, 0.0])
@pytest.mark.parametrize("thickness", [1 / 3, 0.6, 2.0])
@pytest.mark.parametrize("ratio", [np.inf, 100.0, 0.3])
def test_a_sphere_is_right_to_the_depth_it_names(nu, thickness, ratio):
    """Extrapolated from the equator on, the radius stood at 0.9999 R and dP/dw was up to 19 % away."""
    fine = law_to_the_end(nu, thickness, ratio, 1e-10)
    depth = np.concatenate((np.linspace(0.02, 0.98, 25), np.linspace(0.981, 0.9998, 20))) * fine.max_depth
    step = STEP * depth
    slope = (fine.force(depth + step) - fine.force(depth - step)) / (2.0 * step)
    np.testing.assert_allclose(fine.stiffness(depth), slope, rtol=2e-6)
    radius = fine.contact_radius(depth)
    assert (np.diff(radius) > 0.0).all()
    assert radius[-1] < R
    for rtol in (1e-2, 1e-4, 1e-6):
        law = law_to_the_end(nu, thickness, ratio, rtol)
        within = depth[depth <= min(law.max_depth, fine.max_depth)]
        for name in ("force", "contact_radius", "stiffness"):
            np.testing.assert_allclose(
                getattr(law, name)(within), getattr(fine, name)(within), rtol=law.error_estimate, err_msg=name
            )


@pytest.mark.parametrize(
    ("depth", "nu", "thickness", "end"), [(1.2, 0.5, 1 / 3, 1.08), (2.0, 0.3, 1 / 3, 1.82)]
)
def test_beyond_the_equator_of_a_thin_layer_is_refused(depth, nu, thickness, end):
    with pytest.raises(ul.RangeError, match=r"end of the indenter's shape") as caught:
        ul.contact_law(BALL, layer(nu, thickness), ul.RIGID, max_depth=depth * R, solver="exact")
    assert caught.value.max_depth == pytest.approx(end * R, rel=0.01)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
def test_a_batch_says_which_sets_end_before_its_range(rtol):
    """Sets whose contact is narrower than that compiled for were extrapolated: 1e-4 at an rtol of 1e-6."""
    deepest, thickness = 2.2 * R, R
    nus, moduli = np.array([[0.0], [0.1], [0.3], [0.49]]), np.full((4, 1), 1e4)
    compiled = ExactBatch.compile(
        BALL,
        LayerKernel(isotropic_constants(1e4, 0.0), None),
        thickness=thickness,
        max_depth=deepest,
        rtol=rtol,
    )
    inner = isotropic_constants(moduli, nus)
    curves = compiled.curves(inner, None, np.full(4, thickness))
    depth = np.linspace(0.05, 1.0, 30) * deepest
    force = curves.force(depth, np.asarray(inner.theta)[:, 0], np.full(4, thickness))
    assert curves.error_estimate[3] > rtol  # its contact passes the equator before
    for index in np.flatnonzero(curves.error_estimate <= rtol):
        law = ul.contact_law(
            BALL, layer(float(nus[index, 0]), 1.0), ul.RIGID, max_depth=deepest, solver=ul.Exact(1e-9)
        )
        np.testing.assert_allclose(force[index], law.force(depth), rtol=rtol)


def test_an_asymptotic_radius_does_not_pass_the_sphere():
    """1.06 R at w = 10 R, with a stated error of 0.21."""
    law = ul.contact_law(
        BALL, layer(0.5, 2.0), base(3.0), max_depth=1.2 * R, solver=ul.Asymptotic(4, "compliance")
    )
    deepest = min(law.max_depth, law.max_radius_depth)
    radius = law.contact_radius(np.linspace(0.01, 1.0 - 1e-9, 50) * deepest)
    assert radius.max() <= R
    if law.max_radius_depth < law.max_depth:
        with pytest.raises(ul.RangeError, match="end of the indenter's shape"):
            law.contact_radius(0.5 * (law.max_radius_depth + law.max_depth))


def test_a_published_sphere_deeper_than_its_radius_is_flagged():
    with pytest.warns(ul.UnderlayWarning, match="d/R is 1.5"):
        law = ul.contact_law(BALL, layer(0.5, 10.0), ul.RIGID, max_depth=1.5 * R, solver="garcia2018")
    assert any("d/R" in str(entry) for entry in law.warnings)
    assert law.contact_radius(1.5 * R) > R
    shallow = ul.contact_law(BALL, layer(0.5, 10.0), ul.RIGID, max_depth=0.5 * R, solver="garcia2018")
    assert not shallow.warnings


@pytest.mark.parametrize("solver", ["auto", "exact", "halfspace", ul.Exact(1e-2)])
def test_a_law_deeper_than_its_layer_says_so_itself(solver):
    tip, film, soft = ul.Paraboloid(R), layer(0.45, 0.1), base(0.1)
    (doubt,) = ul.contact_law(tip, film, soft, max_depth=0.15 * R, solver=solver).warnings
    assert doubt == DeeperThanLayer(0.15 * R, film.thickness)
    assert "0.15 um deep into a layer 0.1 um thick" in str(doubt)
    assert not ul.contact_law(tip, film, soft, max_depth=0.1 * R, solver=solver).warnings


def test_a_map_says_it_by_the_short_way_too():
    """One modulus and a contact point: the separable fit, which warned of nothing."""
    scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 1e-4), ul.Isotropic(1e5, 0.45))
    depth = np.linspace(-3e-5, 1.5e-4, 200)
    curve = ul.synthesize(scene, depth, ul.Noise(force=1e-4), 0)
    shallow = curve.select(curve.depth < 0.9e-4)
    table = ul.fit_many([curve, shallow], scene, FREE, workers=0)
    assert isinstance(table, pd.DataFrame)
    assert table.loc[0, "verdict"] == "refused"
    assert "beyond contact where the layer is 0.1 mm thick" in table.loc[0, "reason"]
    assert table.loc[1, "verdict"] != "refused"
