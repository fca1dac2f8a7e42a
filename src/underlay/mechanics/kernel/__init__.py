"""The kernel 1 - L(u): how what lies under the surface changes the surface compliance with the wavenumber.

`kernel` says what every kernel answers, its scales and quadrature; `substrate` is one layer on a base, `stack` are
several; `recursion` is the formula of both.
"""

from underlay.mechanics.kernel.kernel import Compliance, Family, Kernel, Scales, u_rule
from underlay.mechanics.kernel.stack import StackKernel, values_of
from underlay.mechanics.kernel.substrate import LayerKernel, SubstrateKernel

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
