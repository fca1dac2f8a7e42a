"""Hay and Crawford (2011): a flat punch on a film on an elastic base, springs in series and in parallel.

1/mu_c = (1 - phi_0)/(mu_s + F phi_0 mu_f) + phi_0/mu_f, F = 0.0626, and P = 2 a d E'_c with
E'_c = 2 mu_c/(1 - nu_c); phi_0 and the composite nu_c are those of Gao, Chiu and Lee (1992) (`gao_weights`), with
force P, punch radius a, depth d, and the shear moduli mu_f of the film and mu_s of the base.

The fitted F does not vanish with the contrast: film and base of one material still give a force that is up
to 2 % too large.
"""

from __future__ import annotations

import numpy as np

from underlay.mechanics.body import Material
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
from underlay.mechanics.published.gao1992 import gao_weights

_F = 0.0626


def _shear_modulus(material: Material) -> float:
    return material.E / (2.0 * (1.0 + material.nu))


def _punch(contact: LayerContact) -> ConstantFactor:
    film, nu = gao_weights(contact)
    mu_film, mu_base = _shear_modulus(contact.layer), _shear_modulus(contact.elastic_base)
    compliance = (1.0 - film) / (mu_base + _F * film * mu_film) + film / mu_film
    reduced_modulus = 2.0 / ((1.0 - nu) * compliance)
    return ConstantFactor(reduced_modulus / (2.0 * contact.layer.theta))


PUNCH = PublishedCorrection(
    name="hay2011",
    indenter="flat punch",
    substrate=ELASTIC,
    equation=(
        "P = 2 a d 2 mu_c/(1-nu_c), 1/mu_c = (1-phi_0)/(mu_s + 0.0626 phi_0 mu_f) + phi_0/mu_f, "
        "phi_0 and nu_c of gao1992"
    ),
    valid_range=(0.0, np.inf),
    range_basis="any a/h; moduli within a factor of ten of each other, the range measured here",
    nu_range=(0.0, 0.5),
    assumptions=("fitted to finite elements", "linear elasticity, no friction under the punch"),
    source="Hay & Crawford 2011, Journal of Materials Research 26, 727-738",
    doi="10.1557/jmr.2011.8",
    further_limits=(Limit(MODULUS_RATIO, 0.1, 10.0),),
    factor=_punch,
    measured_error=MeasuredError.from_table(
        MATERIALS,
        """
                0.05    0.1   0.2   0.4   0.7     1   1.5     2
0.1  0.3  0.3    2.8    4.2   5.1   5.1   5.1   5.1   5.1   5.1
0.1  0.3  0.5    1.1    1.4   1.4     2     5   6.8   8.4   9.1
0.1  0.5  0.3    3.5    5.3   6.1   6.1   6.1   6.1   6.1   6.1
0.1  0.5  0.5    1.5    1.8   1.8   2.8   6.2   7.6   8.2   8.2
0.3  0.3  0.3   0.76    1.4     2   2.2   2.2   2.2   2.2   2.2
0.3  0.3  0.5  0.054  0.054  0.42   1.6   3.2   4.3   5.3   5.8
0.3  0.5  0.3    1.5    2.5   3.8   4.9   5.1   5.2   5.2   5.2
0.3  0.5  0.5   0.56   0.86  0.97  0.97  0.97   1.6   2.1   2.2
0.5  0.3  0.3   0.52   0.95   1.6   2.2   2.3   2.3   2.3   2.3
0.5  0.3  0.5   0.21   0.35  0.44  0.44  0.71   1.6   2.5     3
0.5  0.5  0.3    0.9    1.7   2.9   4.2   4.9   5.1   5.1   5.1
0.5  0.5  0.5   0.53   0.94   1.5   1.7   1.7   1.7   1.7   1.7
0.7  0.3  0.3   0.38    0.7   1.3   1.9   2.2   2.2   2.2   2.2
0.7  0.3  0.5   0.29   0.52  0.86   1.1   1.1   1.1   1.1   1.1
0.7  0.5  0.3   0.56    1.1   1.9     3   3.6   3.7   3.7   3.7
0.7  0.5  0.5   0.44    0.8   1.4   1.9     2     2     2     2
  1  0.3  0.3   0.22   0.43  0.78   1.3   1.6   1.6   1.6   1.6
  1  0.3  0.5   0.32   0.61   1.1   1.8     2     2     2     2
  1  0.5  0.3   0.21    0.4  0.71   1.1   1.2   1.2   1.2   1.2
  1  0.5  0.5   0.27   0.52  0.92   1.4   1.6   1.6   1.6   1.6
1.5  0.3  0.3  0.056   0.11  0.19  0.29  0.34  0.34  0.34  0.34
1.5  0.3  0.5   0.32   0.61   1.2   2.1     3   3.4   3.6   3.7
1.5  0.5  0.3   0.17   0.34  0.71   1.5   2.4   3.1   3.7     4
1.5  0.5  0.5   0.05  0.089  0.15  0.17  0.17  0.17  0.17  0.17
  2  0.3  0.3  0.051   0.11  0.23  0.46  0.69  0.81  0.95   1.1
  2  0.3  0.5    0.3   0.58   1.2   2.1   3.4   4.2   5.1   5.3
  2  0.5  0.3    0.4    0.8   1.7   3.3   5.2   6.5   7.8   8.3
  2  0.5  0.5   0.11   0.23  0.48  0.94   1.4   1.6   1.7   1.7
  4  0.3  0.3   0.26   0.52   1.1   2.1   3.2   3.9   4.6   5.1
  4  0.3  0.5   0.23   0.46  0.91   1.9   3.7   5.6     8   9.3
  4  0.5  0.3   0.82    1.7   3.5   7.1    12    15    19    21
  4  0.5  0.5   0.43   0.89   1.9   3.7   5.5   6.5   7.3   7.7
 10  0.3  0.3   0.41   0.85   1.8   3.6   5.7   7.2     9    11
 10  0.3  0.5   0.17   0.33  0.66   1.6   3.7   6.4    11    14
 10  0.5  0.3    1.2    2.4   4.9    11    18    24    32    37
 10  0.5  0.5   0.69    1.5     3   6.2   9.9    13    16    18
""",
    ),
)
