"""The shipped tables of isotropic draining layers: how they are solved for, and how far off they are.

To build both again: ``python tests/support/draining_tables.py`` (src and tests on the path; a quarter of an hour).
"""

from functools import partial

import numpy as np

from underlay.mechanics.biphasic.contacts import DrainingTip
from underlay.mechanics.biphasic.history import ramp_and_hold, table_times
from underlay.mechanics.biphasic.material import Biphasic, Skeleton, elastic_law, punch_factor
from underlay.mechanics.biphasic.tables import (
    ENDS_AXES,
    IN_HOLD,
    LARGEST_EPS,
    PUNCH_AXES,
    PUNCH_FILE,
    TIP_AXES,
    TIP_FILE,
    ResponseTable,
    hold_lags,
    ramp_nodes,
)
from underlay.mechanics.biphasic.transfer import PunchTransfer, relaxation
from underlay.mechanics.body import PlaneConstants
from underlay.mechanics.indenters import Paraboloid

SPAN = (1e-4, 100.0)
TABULATED = ("solid", "porous")


def of_punch(shape, nu, drainage):
    """Response of an isotropic layer under a flat punch, solved for; `shape` is eps/(1 + eps), eps = a/h."""
    return relaxation(PunchTransfer(Skeleton.of_poisson_ratio(nu), shape / (1.0 - shape), drainage), SPAN)


def compliance(shape, softness):
    """Dimensionless compliance 4 A44 a w/P of a flat punch on an elastic layer; `softness` is A44/A33.

    It is smooth in both arguments, which the force is not, and so is what the table holds.
    """
    constants = PlaneConstants(1.0 - 2.0 * softness, softness, 4.0 * (1.0 - softness), 1.0)
    return 1.0 / (punch_factor(constants, shape / (1.0 - shape)) * float(constants.theta))


def of_tip(shape, nu, log_ramp, drainage):
    """The undrained share q of the force of a paraboloid at the table's times, (times,).

    `shape` is eps/(1 + eps), eps = a0/h; `log_ramp` the logarithm of the ramp's duration in a0^2/c.
    """
    thickness = np.inf if shape == 0.0 else (1.0 - shape) / shape
    E = 2.0 * (1.0 + nu)
    material = Biphasic(E, nu, 1.0 / Biphasic(E, nu, 1.0).aggregate_modulus)
    depth, ramp = depth_of_unit_radius(material, thickness), float(np.exp(log_ramp))
    time = np.concatenate((ramp * ramp_nodes(), ramp + hold_lags(ramp)))
    contact = DrainingTip(Paraboloid(1.0), material, thickness, drainage)
    history = ramp_and_hold(depth, ramp)
    w = history.at(time)
    kept = contact.drained(depth).force(w) / contact.undrained(depth).force(w)
    ratio = contact.record(history, float(time[-1])).ratio_at(time)
    return (ratio - kept) / (1.0 - kept)


def depth_of_unit_radius(material, thickness):
    """Depth at which a paraboloid of radius 1 has a contact of radius 1 on the undrained layer."""
    low, high = 0.2, 1.0  # a^2/R times 1/2 or less on thin layers, 1 on a half-space
    law = elastic_law(material.undrained.plane_constants, Paraboloid(1.0), thickness, high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if float(law.contact_radius(middle)) < 1.0 else (low, middle)
    return high


def punch_error(table, count, seed):
    """Largest error of the punch's normalised fall at `count` random points, and the point (eps/(1 + eps), nu)."""
    rng = np.random.default_rng(seed)
    worst = 0.0, (0.0, 0.0)
    for _ in range(count):
        point = tuple(float(rng.uniform(axis.low, axis.high)) for axis in PUNCH_AXES)
        error = float(np.abs(table.table.at(point) - of_punch(*point, table.drainage).fall).max())
        worst = max(worst, (error, point))
    return worst


def tip_error(table, count, seed):
    """Largest error of the paraboloid's q at `count` random points, and the point of the table's axes.

    On the ramp the error is weighted by (t/tr)^(3/2), the largest share of the peak force reached at time t of tr.
    """
    rng = np.random.default_rng(seed)
    reached = np.concatenate((ramp_nodes() ** 1.5, np.ones(IN_HOLD)))
    worst = 0.0, (0.0, 0.0, 0.0)
    for _ in range(count):
        shape, nu, log_ramp = (float(rng.uniform(axis.low, axis.high)) for axis in TIP_AXES)
        point = shape * LARGEST_EPS / (1.0 + LARGEST_EPS) / TIP_AXES[0].high, nu, log_ramp
        error = float(np.abs(reached * (table.table.at(point) - of_tip(*point, table.drainage))).max())
        worst = max(worst, (error, point))
    return worst


def main():
    """Solve for the tables of all drainages and write the files."""
    falls = {
        tip: ResponseTable.solved(PUNCH_AXES, lambda *at, by=tip: of_punch(*at, by).fall).fall
        for tip in TABULATED
    }
    ends = ResponseTable.solved(ENDS_AXES, compliance).fall
    np.savez_compressed(PUNCH_FILE, time=table_times(SPAN), ends=ends, **falls)
    tips = {tip: ResponseTable.solved(TIP_AXES, partial(of_tip, drainage=tip)).fall for tip in TABULATED}
    np.savez_compressed(TIP_FILE, **tips)


if __name__ == "__main__":
    main()
