"""The kernel 1 - L(u): how what lies under the surface changes the surface compliance with the wavenumber.

`kernel` says what every kernel answers; `substrate` is one layer on a base, `one_layer` its formula; `scales`
are the wavenumbers at which a kernel bends, `quadrature` its integrals.
"""

from underlay.mechanics.kernel.kernel import Compliance, Family, Kernel, Scales, u_rule
from underlay.mechanics.kernel.one_layer import one_minus_L
from underlay.mechanics.kernel.stack import StackKernel
from underlay.mechanics.kernel.substrate import LayerKernel, SubstrateKernel, coefficients

__all__ = [
    "Compliance",
    "Family",
    "Kernel",
    "LayerKernel",
    "Scales",
    "StackKernel",
    "SubstrateKernel",
    "coefficients",
    "one_minus_L",
    "u_rule",
]
