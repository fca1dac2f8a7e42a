"""Gao, Chiu and Lee (1992): a flat punch on a film on an elastic base, by a first-order perturbation.

P = 2 a d E', E' = E'_s + (E'_f - E'_s) phi_0(x), x = h/a, E' = E/(1 - nu^2);
phi_0 = (2/pi) atan x + [(1-2 nu) x ln(1 + 1/x^2) - x/(1+x^2)]/(2 pi (1-nu)),
nu = 1 - (1-nu_s)(1-nu_f)/[1 - (1-phi_1) nu_f - phi_1 nu_s], phi_1 = (2/pi) atan x + (x/pi) ln(1 + 1/x^2),

with punch radius a, depth d, film thickness h, f the film and s the base. Written here, as most users write it,
with the reduced moduli mixed by phi_0. With equal Poisson's ratios the composite nu is theirs. First order in
the contrast: good for moduli that differ by a factor of two.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from underlay.mechanics.published.correction import (
    ELASTIC,
    MATERIALS,
    MODULUS_RATIO,
    ConstantFactor,
    LayerContact,
    Limit,
    MeasuredError,
    PublishedCorrection,
)


class Weights(NamedTuple):
    """Weight of the film, and Poisson's ratio of film and base together, under a flat punch.

    Attributes
    ----------
    film : float
        phi_0, from 0 (base alone) to 1 (film alone).
    nu : float
        Composite Poisson's ratio.
    """

    film: float
    nu: float


def gao_weights(contact: LayerContact) -> Weights:
    """Weights phi_0 and nu (module's head) under a flat punch, from h/a and the two Poisson's ratios."""
    x = 1.0 / contact.radius_ratio
    nu_film, nu_base = contact.layer.nu, contact.elastic_base.nu
    angle = 2.0 / np.pi * np.arctan(x)
    logarithm = x * np.log1p(1.0 / x**2)
    phi_1 = angle + logarithm / np.pi
    nu = 1.0 - (1.0 - nu_base) * (1.0 - nu_film) / (1.0 - (1.0 - phi_1) * nu_film - phi_1 * nu_base)
    phi_0 = angle + ((1.0 - 2.0 * nu) * logarithm - x / (1.0 + x**2)) / (2.0 * np.pi * (1.0 - nu))
    return Weights(film=float(phi_0), nu=float(nu))


def _punch(contact: LayerContact) -> ConstantFactor:
    film = gao_weights(contact).film
    base_ratio = contact.reduced_modulus_ratio
    return ConstantFactor(base_ratio + (1.0 - base_ratio) * film)


PUNCH = PublishedCorrection(
    name="gao1992",
    indenter="flat punch",
    substrate=ELASTIC,
    equation=(
        "P = 2 a d E', E' = E'_s + (E'_f - E'_s) phi_0; x = h/a, "
        "phi_0 = (2/pi) atan x + [(1-2nu) x ln(1 + 1/x^2) - x/(1+x^2)]/(2 pi (1-nu))"
    ),
    valid_range=(0.0, np.inf),
    range_basis="any a/h, for moduli within a factor of two of each other (first order in the contrast)",
    nu_range=(0.0, 0.5),
    assumptions=(
        "moduli of film and base not far apart",
        "linear elasticity, no friction under the punch",
    ),
    source="Gao, Chiu & Lee 1992, International Journal of Solids and Structures 29, 2471-2492",
    doi="10.1016/0020-7683(92)90004-D",
    further_limits=(Limit(MODULUS_RATIO, 0.5, 2.0),),
    factor=_punch,
    measured_error=MeasuredError.from_table(
        MATERIALS,
        """
               0.05   0.1   0.2  0.4  0.7    1  1.5    2
0.1  0.3  0.3    20    37    67  110  140  150  150  150
0.1  0.3  0.5    19    37    66  110  130  140  140  140
0.1  0.5  0.3    22    42    73  120  140  140  140  140
0.1  0.5  0.5    22    41    72  110  130  130  130  130
0.3  0.3  0.3   4.8   9.1    17   27   32   33   33   33
0.3  0.3  0.5     5   9.5    18   28   34   34   34   34
0.3  0.5  0.3   5.1   9.5    17   25   27   27   27   27
0.3  0.5  0.5   5.5    11    19   27   30   30   30   30
0.5  0.3  0.3   1.6     3   5.4  8.6   11   11   11   11
0.5  0.3  0.5     2   3.8     7   12   15   16   16   16
0.5  0.5  0.3   1.2   2.2   3.6  4.5  4.5  4.5  4.5  4.5
0.5  0.5  0.5   1.9   3.5     6  8.9  9.7  9.7  9.7  9.7
0.7  0.3  0.3  0.42   0.8   1.5  2.3  2.8  2.8  2.8  2.8
0.7  0.3  0.5  0.99     2   3.8  6.6  9.1   10   11   11
0.7  0.5  0.3   0.3  0.64   1.5  3.3  5.5  6.8  7.4  7.4
0.7  0.5  0.5  0.49  0.92   1.7  2.4  2.6  2.6  2.6  2.6
  1  0.3  0.3     0     0     0    0    0    0    0    0
  1  0.3  0.5  0.82   1.7   3.2    6  8.8   11   11   11
  1  0.5  0.3   1.1   2.1   3.9  7.1   11   12   13   13
  1  0.5  0.5     0     0     0    0    0    0    0    0
1.5  0.3  0.3  0.58   1.1     2  3.1  3.7  3.7  3.7  3.7
1.5  0.3  0.5   1.8   3.5   6.7   12   16   18   18   18
1.5  0.5  0.3  0.71   1.5   3.1  6.1  9.7   12   14   14
1.5  0.5  0.5  0.69   1.3   2.3  3.3  3.5  3.5  3.5  3.5
  2  0.3  0.3   1.8   3.4     6  9.4   12   12   12   12
  2  0.3  0.5   3.4   6.6    13   21   27   29   29   29
  2  0.5  0.3  0.32  0.46  0.46  1.6  5.3  8.3   12   13
  2  0.5  0.5   2.1     4   6.9  9.9   11   11   11   11
  4  0.3  0.3   8.1    16    28   43   51   51   51   51
  4  0.3  0.5    12    22    40   64   79   81   81   81
  4  0.5  0.3   6.4    12    20   26   27   27   27   27
  4  0.5  0.5   9.8    19    32   46   49   49   49   49
 10  0.3  0.3    30    57   110  160  190  190  190  190
 10  0.3  0.5    38    72   140  210  250  260  260  260
 10  0.5  0.3    28    52    89  130  130  130  130  130
 10  0.5  0.5    36    68   120  170  180  180  180  180
""",
    ),
)
