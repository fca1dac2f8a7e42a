"""A tip on a layer that relaxes on an elastic base, solved step by step: a reference that assumes no history.

Lengths are in thicknesses, times in relaxation times, forces in 4 theta of the layer at once. With phi(x) the Abel
transform of the pressure, P = int phi, and m = m0 e(t) the ratio of the shear moduli, the depth below the tip is

    h(x, t) = int [ j(t - s) dphi(x, s) - (1/pi) int (kappa(x - y, t - s) + kappa(x + y, t - s)) dphi(y, s) dy ],
    kappa(z, t) = int_0^inf (j(t) - c(u, t)) cos(u z) du,

where c(u, t) is the creep function of L(u; m) / m over 1 / m0 and j(t) = c(inf, t) that of the layer alone. As a
function of m it is r_0 / m + r_1 / (m + m_1) + r_2 / (m + m_2): a layer, and two layers beside springs.

Nothing of it comes from the package: no contact law, no relaxation as exponentials, no rational approximation.
"""

import numpy as np


def kernel_polynomials(u, nu, base_nu):
    """L = (n2 m^2 + n1 m + n0) / (d2 m^2 + d1 m + d0) of a bonded layer at u: (n2, n1, n0), (d2, d1, d0)."""
    k1, k2, f, e = 3.0 - 4.0 * nu, 3.0 - 4.0 * base_nu, -np.expm1(-2.0 * u), np.exp(-2.0 * u)
    d2 = 4.0 * k2 * e * (np.sinh(u) ** 2 - u**2)
    d1 = f * (1.0 + k1) * (1.0 + k2) - f**2 * (k1 + k2) + 4.0 * u**2 * (k2 - 1.0) * e
    d0 = k1 * (1.0 + e**2) + (1.0 + 4.0 * u**2 + k1**2) * e
    n2 = k2 * (1.0 - e**2 + 4.0 * u * e)
    n1 = 1.0 + k1 * k2 - 4.0 * u * e * (k2 - 1.0) + (k1 + k2) * e**2
    n0 = k1 * (1.0 - e**2) - 4.0 * u * e
    return (n2, n1, n0), (d2, d1, d0)


def creep_of_kernel(u, time, ratio, m0, nu, base_nu):
    """c(u, t), (times, u), of a layer that keeps 1 / ratio of its modulus."""
    (n2, n1, n0), (d2, d1, d0) = kernel_polynomials(u, nu, base_nu)
    q = 0.5 * (d1 + np.sqrt(d1**2 - 4.0 * d2 * d0))
    far, near = q / d2, d0 / q
    residue = [
        (n2 * own**2 - n1 * own + n0) / (own * d2 * (own - other))
        for own, other in ((far, near), (near, far))
    ]
    parts = ((n0 / d0, np.zeros_like(u)), (residue[0], far), (residue[1], near))
    return m0 * sum(part * creep_beside_a_spring(time[:, None], ratio, m0, m) for part, m in parts)


def creep_beside_a_spring(time, ratio, m0, m):
    """Creep function of the modulus m0 e(t) + m, e = 1 / ratio + (1 - 1 / ratio) exp(-t)."""
    at_once, later = 1.0 / (m0 + m), 1.0 / (m0 / ratio + m)
    return later - (later - at_once) * np.exp(-time * at_once / later)


def step_by_step(depth, step, ratio, m0, *, nu=0.5, base_nu=0.3, punch=None, nodes=40, reach=1.2):
    """Force over 4 theta and contact radius, each (n,), of depths (n,) that do not go back, one `step` apart.

    A paraboloid of radius 1 that touches first at the first depth, zero, or a flat `punch` of this radius with a
    sudden first depth. Errors are of second order in the step and in the distance of the `nodes` on `reach`.
    """
    end, count = punch or reach, len(depth)
    x = (np.arange(nodes) + 0.5) * (end / nodes)
    root, weight = np.polynomial.legendre.leggauss(90)
    u, weight = 10.0 * (root + 1.0), 10.0 * weight
    cosines = np.cos(np.outer(u, x))

    def operators(lag):
        own = m0 * creep_beside_a_spring(lag, ratio, m0, 0.0)
        change = own[:, None] - creep_of_kernel(u, lag, ratio, m0, nu, base_nu)
        smooth = np.array([cosines.T @ (cosines * (weight * row)[:, None]) for row in change])
        return own[:, None, None] * np.eye(nodes) - smooth * (2.0 * end / (nodes * np.pi))

    # A change within a step comes half a step before its end; the first one is sudden.
    of_first, of_step = operators(step * np.arange(count)), operators(step * (np.arange(count) + 0.5))
    profile = np.zeros(nodes) if punch else x**2
    changes, radius, touched = np.zeros((count, nodes)), np.zeros(count), nodes if punch else 0
    for n in range(count):
        now = of_first[0] if n == 0 else of_step[0]
        missing = depth[n] - profile
        if n:
            past = np.einsum("kij,kj->i", of_step[1:n][::-1], changes[1:n])
            missing = missing - of_first[n] @ changes[0] - past
        while True:
            change = np.zeros(nodes)
            change[:touched] = np.linalg.solve(now[:touched, :touched], missing[:touched])
            # The next node is in contact if the tip would go through it.
            if touched == nodes or (missing - now @ change)[touched] <= 0.0:
                break
            touched += 1
        changes[n], radius[n] = change, touched * end / nodes
    return changes.cumsum(axis=0).sum(axis=1) * end / nodes, radius
