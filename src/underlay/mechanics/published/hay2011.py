"""Hay and Crawford (2011): a flat punch on a film on an elastic base, springs in series and in parallel.

1/mu_c = (1 - phi_0)/(mu_s + F phi_0 mu_f) + phi_0/mu_f, F = 0.0626, and P = 2 a d E'_c with
E'_c = 2 mu_c/(1 - nu_c); phi_0 and the composite nu_c are those of Gao, Chiu and Lee (1992).
"""

from __future__ import annotations

import numpy as np

from underlay.mechanics.materials import Isotropic
from underlay.mechanics.published.correction import ELASTIC, PublishedCorrection
from underlay.mechanics.published.factor import ConstantFactor
from underlay.mechanics.published.gao1992 import gao_weights
from underlay.mechanics.published.layer_contact import LayerContact
from underlay.mechanics.published.limits import Limit
from underlay.mechanics.published.measured_error import MeasuredError
from underlay.mechanics.published.quantities import MATERIALS, MODULUS_RATIO

__all__ = ["PUNCH"]

_F = 0.0626


def _shear_modulus(material: Isotropic) -> float:
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
0.05 0.1 0.2 0.4 0.7 1 1.5 2
0.1 0.3 0.3 0 0 0 0 0 0 0 0
0.3 0.3 0.3 0 0 0 0 0 0 0 0
0.5 0.3 0.3 0 0 0 0 0 0 0 0
0.7 0.3 0.3 0 0 0 0 0 0 0 0
1 0.3 0.3 0 0 0 0 0 0 0 0
1.5 0.3 0.3 0 0 0 0 0 0 0 0
2 0.3 0.3 0 0 0 0 0 0 0 0
4 0.3 0.3 0 0 0 0 0 0 0 0
10 0.3 0.3 0 0 0 0 0 0 0 0
0.1 0.3 0.5 0 0 0 0 0 0 0 0
0.3 0.3 0.5 0 0 0 0 0 0 0 0
0.5 0.3 0.5 0 0 0 0 0 0 0 0
0.7 0.3 0.5 0 0 0 0 0 0 0 0
1 0.3 0.5 0 0 0 0 0 0 0 0
1.5 0.3 0.5 0 0 0 0 0 0 0 0
2 0.3 0.5 0 0 0 0 0 0 0 0
4 0.3 0.5 0 0 0 0 0 0 0 0
10 0.3 0.5 0 0 0 0 0 0 0 0
0.1 0.5 0.3 0 0 0 0 0 0 0 0
0.3 0.5 0.3 0 0 0 0 0 0 0 0
0.5 0.5 0.3 0 0 0 0 0 0 0 0
0.7 0.5 0.3 0 0 0 0 0 0 0 0
1 0.5 0.3 0 0 0 0 0 0 0 0
1.5 0.5 0.3 0 0 0 0 0 0 0 0
2 0.5 0.3 0 0 0 0 0 0 0 0
4 0.5 0.3 0 0 0 0 0 0 0 0
10 0.5 0.3 0 0 0 0 0 0 0 0
0.1 0.5 0.5 0 0 0 0 0 0 0 0
0.3 0.5 0.5 0 0 0 0 0 0 0 0
0.5 0.5 0.5 0 0 0 0 0 0 0 0
0.7 0.5 0.5 0 0 0 0 0 0 0 0
1 0.5 0.5 0 0 0 0 0 0 0 0
1.5 0.5 0.5 0 0 0 0 0 0 0 0
2 0.5 0.5 0 0 0 0 0 0 0 0
4 0.5 0.5 0 0 0 0 0 0 0 0
10 0.5 0.5 0 0 0 0 0 0 0 0
""",
    ),
)
