"""Hard cases with known answers, as tables: run with -s to read the digits that hold.

Each area keeps its cases in one tuple and its reference in tests/support; a row is added per case.
"""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

import underlay as ul
from support.hard_case_table import HardCaseTable, Row
from support.transfer_matrix import TransferMatrixKernel

# --- the kernel L(u) --------------------------------------------------------------------------------------

# From 1e-8 to 1e3, on both sides of u sigma = 3 for the common roots, where the evaluation changes form.
U = np.array([1e-8, 1e-5, 1e-3, 0.02, 0.1, 0.3, 0.7, 1.0, 1.49, 1.51, 2.5, 6.0, 20.0, 1e3])


def nearly_isotropic(difference: float) -> ul.TransverselyIsotropic:
    return ul.TransverselyIsotropic(E=1.0, E_axial=1.0 + difference, nu=0.3, nu_axial=0.3, G_axial=1.0 / 2.6)


ZINC = ul.TransverselyIsotropic.from_stiffness(A11=161e9, A12=34.2e9, A13=50.1e9, A33=61.0e9, A44=38.3e9)
STEEL = ul.Isotropic(210e9, 0.3)
INCOMPRESSIBLE = ul.Isotropic(1.0, 0.5)
SOFT_AXIS = ul.TransverselyIsotropic(E=5.8e6, E_axial=0.46e6, nu=0.3, nu_axial=0.02, G_axial=0.37e6)
STIFF_AXIS = ul.TransverselyIsotropic(E=1.0, E_axial=20.0, nu=0.3, nu_axial=0.25, G_axial=0.5)
SHEARS_EASILY = ul.TransverselyIsotropic(E=1.0, E_axial=1.0, nu=0.3, nu_axial=0.3, G_axial=0.01)
RESISTS_SHEAR = ul.TransverselyIsotropic(E=1.0, E_axial=1.0, nu=0.3, nu_axial=0.3, G_axial=1.0)
# 1 - nu - 2 (E/E') nu'^2 = 0: incompressible, without being isotropic.
INCOMPRESSIBLE_AXIS = ul.TransverselyIsotropic(E=1.0, E_axial=2.0, nu=0.75, nu_axial=0.5, G_axial=0.3)

KERNEL_CASES = (
    ("rigid, nu = 0.5", INCOMPRESSIBLE, ul.RIGID),
    ("rigid, nu = 0.5 - 1e-12", ul.Isotropic(1.0, 0.5 - 1e-12), ul.RIGID),
    ("rigid, nu = 0.3", ul.Isotropic(1.0, 0.3), ul.RIGID),
    ("rigid, nu = 0", ul.Isotropic(1.0, 0.0), ul.RIGID),
    ("rigid, auxetic nu = -0.9", ul.Isotropic(1.0, -0.9), ul.RIGID),
    *(
        (f"nu = {nu1} on nu = {nu2}, E2/E1 = {ratio:g}", ul.Isotropic(1.0, nu1), ul.Isotropic(ratio, nu2))
        for ratio in (1e-8, 1e-6, 1e-4, 1e-2, 0.1, 0.5, 0.6, 2.0, 10.0, 1e3, 1e8)
        for nu1, nu2 in ((0.5, 0.5), (0.3, 0.4))
    ),
    ("nu = 0.5 - 1e-12 on nu = 0.5, E2/E1 = 1e-8", ul.Isotropic(1.0, 0.5 - 1e-12), ul.Isotropic(1e-8, 0.5)),
    ("nu = 0.5 - 1e-12 on nu = 0.5, E2/E1 = 1e8", ul.Isotropic(1.0, 0.5 - 1e-12), ul.Isotropic(1e8, 0.5)),
    ("auxetic nu = -0.9 on nu = 0.5, E2/E1 = 1e-8", ul.Isotropic(1.0, -0.9), ul.Isotropic(1e-8, 0.5)),
    ("nu = 0.5 on auxetic nu = -0.9, E2/E1 = 1e-8", INCOMPRESSIBLE, ul.Isotropic(1e-8, -0.9)),
    ("auxetic nu = -0.9 on nu = 0.2, E2/E1 = 0.1", ul.Isotropic(1.0, -0.9), ul.Isotropic(0.1, 0.2)),
    *(
        (f"nearly isotropic by {d:g} on {name}", nearly_isotropic(d), base)
        for d in (1e-4, -1e-4, 1e-8, -1e-8, 1e-12, -1e-12)
        for name, base in (("rigid", ul.RIGID), ("E2/E1 = 1e-6", ul.Isotropic(1e-6, 0.3)))
    ),
    ("isotropic on nearly isotropic by 1e-12", ul.Isotropic(1.0, 0.3), nearly_isotropic(1e-12)),
    ("equal constants, written both ways", nearly_isotropic(0.0), ul.Isotropic(1.0, 0.3)),
    ("identical, nu = 0.5", INCOMPRESSIBLE, ul.Isotropic(1.0, 0.5)),
    ("identical, zinc", ZINC, ZINC),
    ("zinc (complex roots) on rigid", ZINC, ul.RIGID),
    ("zinc on steel", ZINC, STEEL),
    ("steel on zinc", STEEL, ZINC),
    ("zinc on nu = 0.3, 1e-5 of it", ZINC, ul.Isotropic(6e5, 0.3)),
    ("zinc on nu = 0.5, 1e-8 of it", ZINC, ul.Isotropic(6e2, 0.5)),
    ("soft axis on stiff axis", SOFT_AXIS, STIFF_AXIS),
    ("stiff axis on soft axis", STIFF_AXIS, SOFT_AXIS),
    ("soft axis on zinc", SOFT_AXIS, ZINC),
    ("stiff axis on rigid", STIFF_AXIS, ul.RIGID),
    ("stiff axis on nu = 0.5, 1e-3 of it", STIFF_AXIS, ul.Isotropic(1e-3, 0.5)),
    ("soft axis on nu = 0.5, 1e-8 of it", SOFT_AXIS, ul.Isotropic(5.8e-2, 0.5)),
    ("shears easily (G' = 0.01 E) on rigid", SHEARS_EASILY, ul.RIGID),
    ("shears easily on nu = 0.5, 1e-3 of it", SHEARS_EASILY, ul.Isotropic(1e-3, 0.5)),
    ("shears easily on nu = 0.5, 1e-8 of it", SHEARS_EASILY, ul.Isotropic(1e-8, 0.5)),
    ("resists shear (G' = E) on rigid", RESISTS_SHEAR, ul.RIGID),
    ("resists shear on shears easily", RESISTS_SHEAR, SHEARS_EASILY),
    ("incompressible, transversely isotropic, on rigid", INCOMPRESSIBLE_AXIS, ul.RIGID),
    ("incompressible, transversely isotropic, on 1e-6 of it", INCOMPRESSIBLE_AXIS, ul.Isotropic(1e-6, 0.5)),
)


@pytest.fixture(scope="module")
def kernel_table():
    return HardCaseTable("Kernel L(u), 14 u from 1e-8 to 1e3, against a 50-digit transfer matrix")


@pytest.mark.parametrize(("case", "layer", "substrate"), KERNEL_CASES, ids=[c[0] for c in KERNEL_CASES])
def test_kernel_holds_against_the_transfer_matrix(case, layer, substrate, kernel_table):
    # L to 1e-14 absolute. On a soft substrate L grows to theta1/theta2 and is held to 1e-13 relative: a few
    # hundred roundings of the 50 or so operations, once the cancellation of small u is worked out.
    reference = TransferMatrixKernel(layer, substrate)
    exact = [reference.L(u) for u in U]
    computed = ul.SubstrateKernel(layer, substrate).one_minus_L(U)
    errors = [abs(mp.mpf(float(c)) - (1 - e)) for c, e in zip(computed, exact, strict=True)]
    absolute = float(max(errors))
    relative = float(max(error / abs(e) for error, e in zip(errors, exact, strict=True)))
    soft = exact[0] > 1.001  # the base alone is softer than the layer
    worst, limit = (relative, 1e-13) if soft else (absolute, 1e-14)
    kernel_table.add(Row(case, absolute, relative, "relative" if soft else "absolute", worst, limit))
    assert worst <= limit


@pytest.mark.parametrize(
    "material",
    [INCOMPRESSIBLE, STEEL, ul.Isotropic(3.7e4, -0.9), ZINC, SOFT_AXIS, STIFF_AXIS, nearly_isotropic(1e-8)],
    ids=repr,
)
def test_identical_materials_give_one_to_the_last_bit(material):
    assert np.array_equal(ul.SubstrateKernel(material, material).one_minus_L(U), np.zeros_like(U))


def test_there_are_at_least_forty_kernel_cases():
    assert len({(repr(layer), repr(base)) for _, layer, base in KERNEL_CASES}) >= 40
