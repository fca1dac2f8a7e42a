"""Curves kept in a file: as accurate as they claim, of every body that they are for, refused when stale."""

import numpy as np
import pytest

import underlay as ul
from studies.stored_curves import RTOL, write
from underlay.mechanics.body import isotropic_constants, transversely_isotropic_constants
from underlay.mechanics.exact import stored_curves as module
from underlay.mechanics.exact.contact_problem import ContactProblem
from underlay.mechanics.exact.curve_family import IsotropicPair, RigidBase, range_end
from underlay.mechanics.exact.master_curve import Factor
from underlay.mechanics.exact.stored_curves import (
    EXPONENT,
    FILE,
    STORED_ERROR,
    TOP,
    StoredCurves,
    known_curve,
    stored_curve,
)
from underlay.mechanics.kernel import LayerKernel


def random_bodies(count):
    """Layers of any Poisson's ratio, the ends among them, on bases of 0.006 to 300 times theirs, or rigid."""
    rng = np.random.default_rng(8)
    for _ in range(count):
        layer_nu, base_nu = rng.choice([0.0, 0.3, 0.45, 0.499, 0.5, rng.uniform(0.0, 0.5)], 2).tolist()
        ratio = float(np.exp(rng.uniform(np.log(0.006), np.log(300.0))))
        family = RigidBase(layer_nu) if rng.random() < 0.1 else IsotropicPair(layer_nu, base_nu)
        yield family.kernel(ratio)


def solved(body, rtol=RTOL):
    """Solved where so much accuracy is asked for, else stored."""
    return known_curve(ContactProblem.of(ul.PowerLaw(EXPONENT, 1.0), 1.0, body), TOP, rtol)


@pytest.mark.parametrize(("top", "rtol"), [(TOP, 1e-5), (4.0, 4e-7), (1.3, 4e-7), (0.1, 1e-5), (0.01, 1e-3)])
def test_what_is_stored_is_what_is_solved(top, rtol):
    bodies, varpi = list(random_bodies(40)), np.geomspace(1e-3, 1.0, 100) * top
    for body in bodies:
        stored = stored_curve(body, EXPONENT, top, rtol, 0.3)
        if rtol < 1e-6 and body.base is not None and body.base.theta < 0.02 * body.layer.theta:
            assert stored is None  # the softest bases are stored less well
            continue
        assert stored.error_estimate <= rtol
        again = np.array([solved(body).curve.logarithm(which, varpi) for which in Factor])
        told = np.array([stored.curve.logarithm(which, varpi) for which in Factor])
        assert np.abs(told - again).max() < stored.error_estimate + RTOL


@pytest.mark.parametrize("rtol", [1e-5, 1e-3, 1e-2])
def test_a_curve_with_fewer_terms_keeps_the_error_that_it_claims(rtol):
    varpi = np.geomspace(1e-3, TOP, 100)
    # Of a half-space next to nothing is left: few terms, not none.
    for body in (*random_bodies(10), IsotropicPair(0.3, 0.3).kernel(1.0)):
        short, full = solved(body, rtol), solved(body).curve
        assert short.resolution == StoredCurves.read().resolution
        assert short.error_estimate <= rtol
        for which in Factor:
            error = np.abs(np.expm1(short.curve.logarithm(which, varpi) - full.logarithm(which, varpi)))
            assert error.max() < short.error_estimate + RTOL


def test_a_body_is_two_numbers():
    """Three Poisson's ratios and the moduli to them have the same ratio of theta and the same share."""
    u, kernels = np.linspace(0.0, 6.0, 50), []
    for coupling in (0.1, 0.2, 0.3):
        ratio, share = 3.0, 0.4
        layer, base = (
            (1.0 - 2.0 * part) / (2.0 - 2.0 * part)
            for part in (coupling, ratio * coupling - 0.5 * share * (ratio + 1.0) + 0.5)
        )
        kernels.append(
            LayerKernel(
                isotropic_constants(1.0, layer),
                isotropic_constants(ratio * (1.0 - base**2) / (1.0 - layer**2), base),
            ).values(u)
        )
    np.testing.assert_allclose(kernels[1:], [kernels[0]] * 2, rtol=0.0, atol=1e-14)


def test_what_is_not_stored_is_said_to_be_missing():
    body = IsotropicPair(0.45, 0.3).kernel(10.0)
    rtol = 2.0 * STORED_ERROR
    assert stored_curve(body, EXPONENT, 1.0, rtol) is not None
    assert stored_curve(body, 1.0, 1.0, rtol) is None
    assert stored_curve(body, EXPONENT, range_end(4), rtol) is None
    assert stored_curve(body, EXPONENT, 1.0, 0.9 * rtol) is None
    fibres = transversely_isotropic_constants(1.0, 2.0, 0.3, 0.3, 0.5)
    auxetic = isotropic_constants(1.0, -0.2)
    others = [
        IsotropicPair(0.45, 0.3).kernel(1000.0),
        LayerKernel(fibres, body.base),
        LayerKernel(body.layer, fibres),
        LayerKernel(auxetic, None),
        LayerKernel(body.layer, None),
    ]
    held = [stored_curve(other, EXPONENT, 1.0, rtol) is not None for other in others]
    assert held == [False, False, False, False, True]


def test_a_stale_file_is_refused(monkeypatch, tmp_path):
    path = tmp_path / FILE.name
    monkeypatch.setattr(module, "FILE", path)
    kept = StoredCurves(*np.load(FILE, allow_pickle=False).tolist())
    monkeypatch.setattr(module, "MADE_FOR", (*module.MADE_FOR[:-1], module.MADE_FOR[-1] + 1))
    np.save(path, np.load(FILE, allow_pickle=False))
    with pytest.raises(ul.LawError, match="install underlay again"):
        StoredCurves.read()
    np.save(path, kept.series)
    with pytest.raises(ul.LawError, match="does not hold"):
        StoredCurves.read()


def test_what_is_written_is_read(monkeypatch, tmp_path):
    there = StoredCurves.read()
    monkeypatch.setattr(module, "FILE", tmp_path / FILE.name)
    write(there)
    for one, other in zip(there, StoredCurves.read(), strict=True):
        np.testing.assert_array_equal(one, other)
