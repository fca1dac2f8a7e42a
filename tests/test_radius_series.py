"""The inversion of the relation with the contact radius as the variable."""

import numpy as np
import pytest

from underlay.mechanics.exact.master_curve import (
    RadiusSeries,
    Stretch,
    chebyshev_angles,
    chebyshev_coefficients,
)


def made_series(terms=30):
    """varpi = chi exp(-0.3 chi / (1 + chi)), of which the other three logarithms are of no interest here."""
    stretch = Stretch.to(2.0, 0.0)
    angles = chebyshev_angles(terms)
    chi = stretch.v(np.cos(angles))
    values = np.zeros((terms, 4))
    values[:, -1] = -0.3 * chi / (1.0 + chi)
    return RadiusSeries(stretch, chebyshev_coefficients(values, angles))


def test_newton_ends_as_soon_as_it_is_there(monkeypatch):
    series = made_series()
    (branch,) = series.branches()
    steps = []
    real = Stretch.dz

    def counted(stretch, v):
        steps.append(v)
        return real(stretch, v)

    monkeypatch.setattr(Stretch, "dz", counted)
    varpi = np.linspace(0.02, 1.2, 200)
    chi = series.radius(varpi, branch)
    assert chi * np.exp(-0.3 * chi / (1.0 + chi)) == pytest.approx(varpi, rel=1e-12)
    # From a table of 180 points: quadratic steps from 1e-4 or so, and one more to see that it stands still.
    assert len(steps) <= 6


def test_the_stretched_variable_is_turned_round_to_rounding():
    for softness in (0.0, 0.3, 30.0, 1e8):
        for top in (0.02, 1.0, 30.0):
            stretch = Stretch.to(top, softness)
            z = np.linspace(-1.0, 1.0, 50)
            v = stretch.v(z)
            assert v[0] == 0.0
            assert v[-1] == pytest.approx(top, rel=1e-14)
            # What subtracting one from z leaves of t.
            assert stretch.z(v) == pytest.approx(z, abs=1e-15)
