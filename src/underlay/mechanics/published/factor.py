"""Factors that multiply the half-space force, as functions of the size of the contact."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial

from underlay._arrays import FloatArray

__all__ = ["ConstantFactor", "Factor", "PolynomialFactor"]


class Factor(ABC):
    """P / P_halfspace at equal depth, as a function of the dimensionless contact size u."""

    @abstractmethod
    def value(self, u: FloatArray) -> FloatArray:
        """Give the factor (dimensionless), shape of `u`."""

    @abstractmethod
    def slope(self, u: FloatArray) -> FloatArray:
        """Give its derivative with respect to u, shape of `u`."""


@dataclass(frozen=True)
class PolynomialFactor(Factor):
    """c_0 + c_1 u + c_2 u^2 + ..."""

    coefficients: tuple[float, ...]

    def value(self, u: FloatArray) -> FloatArray:
        """Evaluate the polynomial at `u`."""
        return np.asarray(polynomial.polyval(u, self.coefficients))

    def slope(self, u: FloatArray) -> FloatArray:
        """Evaluate its derivative at `u`."""
        return np.asarray(polynomial.polyval(u, polynomial.polyder(self.coefficients)))


@dataclass(frozen=True)
class ConstantFactor(Factor):
    """One number: a flat punch's a/h, hence its factor, is the same at every depth."""

    number: float

    def value(self, u: FloatArray) -> FloatArray:
        """Repeat the number at every `u`."""
        return np.full_like(u, self.number)

    def slope(self, u: FloatArray) -> FloatArray:
        """Give zero."""
        return np.zeros_like(u)
