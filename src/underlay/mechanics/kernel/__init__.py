"""The kernel 1 - L(u): how what lies under the surface changes the surface compliance with the wavenumber.

`kernel` says what every kernel answers, its scales and quadrature; `bodies` are one layer on a base, and several;
`recursion` is the formula of both.
"""

from underlay.mechanics.kernel.bodies import LayerKernel, StackKernel, SubstrateKernel, values_of
from underlay.mechanics.kernel.kernel import Compliance, Family, Kernel, Scales, u_rule

__all__ = [
    "Compliance",
    "Family",
    "Kernel",
    "LayerKernel",
    "Scales",
    "StackKernel",
    "SubstrateKernel",
    "u_rule",
    "values_of",
]
