"""Series identities with 50 digits: the residual of an expansion, and the order at which it vanishes.

The residual of an order-n expansion at eps and eps/10 must fall by 10^(n+1), which a wrong last coefficient
turns into 10^n.
"""

import itertools

import mpmath
import pytest
from mpmath import mpf

import underlay as ul
from underlay.mechanics.asymptotic import blunt
from underlay.mechanics.asymptotic.series import power_law_series

SERIES_EXPONENTS = [mpf(1), mpf("1.5"), mpf(2), mpf(3), mpf(7), mpf(50)]
MOMENTS = [(mpf("1.77"), mpf("-0.958")), (mpf("-0.9"), mpf("0.4")), (mpf("0.1"), mpf("-0.15"))]
CASES = list(itertools.product(SERIES_EXPONENTS, MOMENTS))
IDS = [f"lambda={float(lam)} a_0={float(a[0])}" for lam, a in CASES]
blunt_cases = pytest.mark.parametrize(("lam", "moments"), CASES, ids=IDS)


@pytest.fixture(autouse=True)
def fifty_digits():
    """Import this into a test module to run all of it with 50 digits."""
    with mpmath.workdps(50):
        yield


def order_of(residual, decade=7):
    """Order at which a residual of eps vanishes, from eps = 10^-decade and a tenth of it."""
    large, small = (abs(residual(mpf(10) ** -n)) for n in (decade, decade + 1))
    return float(mpmath.log10(large / small))


def series(coefficients, x):
    return 1 + sum(c * x**n for n, c in enumerate(coefficients, start=1))


def blunt_curve(lam, A, theta, h, moments, form="explicit"):
    """Depth, force and contact radius of A r^lambda on a layer of thickness h and kernel moments (a_0, a_1)."""
    a_0, a_1 = (float(moment) for moment in moments)
    return power_law_series(ul.PowerLaw(lam, A), theta, h, (a_0, a_1), order=4, form=form)


def depth_5_3(eps, lam, moments):
    """w/(A F_2 h^lambda) of (5.3)."""
    return eps**lam * series(blunt.parametric_depth_coefficients(lam, *moments), eps)


def force_5_2(eps, lam, moments):
    """P/(theta A F_1 h^(lambda+1)) of (5.2)."""
    return eps ** (lam + 1) * (1 - blunt.kernel_terms(*moments)[1] * eps**3)
