"""The formulas of the published corrections: a `Factor` from the test, each under its name and kind of indenter.

Their sources, ranges and measured errors are the records of ``corrections.toml``. Throughout, P is the force, d
the depth, h the thickness, R a sphere's or a the punch's radius, alpha a cone's half-angle from the axis, X =
sqrt(R d)/h, L or f the layer and S or s the base.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.polynomial import polynomial
from scipy.interpolate import CubicSpline

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.body import Material
from underlay.mechanics.published.correction import ConstantFactor, Factor, LayerContact, PolynomialFactor

Formula: TypeAlias = Callable[[LayerContact], Factor]


def formula_of(record: Mapping[str, Any]) -> Formula:
    """Formula of an entry of ``corrections.toml``: its polynomial or table, or the function below of its name."""
    if "polynomial" in record:
        return partial(_printed_polynomial, tuple(record["polynomial"]))
    if "table" in record:
        return partial(_from_table, record["name"], record["table"])
    return _FORMULAS[record["name"]]


def _printed_polynomial(coefficients: tuple[float, ...], _contact: LayerContact) -> PolynomialFactor:
    """A polynomial in the contact size that is the same for every test of its range."""
    return PolynomialFactor(coefficients)


def _from_table(name: str, table: Mapping[str, list[float]], contact: LayerContact) -> ConstantFactor:
    """kappa(a/h, nu) of a flat punch, P = 2 a d kappa E/(1-nu^2), by columns of Poisson's ratios.

    Of the table of Hayes et al. the columns of nu = 0.3 and nu = 0.5 could be confirmed, so only they are there;
    another Poisson's ratio is refused rather than given the wrong column, as is often done. Between the entries a
    cubic spline is drawn, with kappa(0) = 1 of the half-space as one more entry; it adds less than 0.03 % to the
    table's own drift, which at a/h = 2 is -0.4 % (nu = 0.3) and -0.9 % (nu = 0.5).
    """
    sizes = table["sizes"]
    columns = {float(nu): values for nu, values in table.items() if nu != "sizes"}
    column = columns.get(contact.layer.nu)
    if column is None:
        raise InputError(
            f"{name} holds the table's columns for nu = {' and '.join(map(str, columns))} alone; the "
            f'layer\'s nu is {contact.layer.nu:.6g}. Take one of those, or the solver "exact", for every nu'
        )
    ratio = contact.radius_ratio
    if ratio > sizes[-1]:
        raise InputError(
            f"the table of {name} ends at a/h = {sizes[-1]:g}; here a/h = {ratio:.6g}. "
            'Take the solver "exact"'
        )
    return ConstantFactor(float(CubicSpline(sizes, column)(np.float64(ratio))))


# --- spheres and cones on a rigid base -------------------------------------------------------------------


def dimitriadis_expansion(alpha: float, beta: float) -> PolynomialFactor:
    """Dimitriadis et al.: 1 - (2 alpha/pi) X + (4 alpha^2/pi^2) X^2 - (8/pi^3)(alpha^3 + 4 pi^2 beta/15) X^3 + ...

    The last term is (16 alpha/pi^4)(alpha^3 + 3 pi^2 beta/5) X^4. The contact radius is held at sqrt(R d); it
    does change, and the exact X^2 coefficient is 7/6 times this one.
    """
    pi = np.pi
    return PolynomialFactor(
        (
            1.0,
            -2.0 * alpha / pi,
            4.0 * alpha**2 / pi**2,
            -(8.0 / pi**3) * (alpha**3 + 4.0 * pi**2 * beta / 15.0),
            (16.0 * alpha / pi**4) * (alpha**3 + 3.0 * pi**2 * beta / 5.0),
        )
    )


def _dimitriadis_bonded(contact: LayerContact) -> PolynomialFactor:
    """The bonded layer, alpha and beta fitted in nu; at nu = 0.5 the source's equation (12) as it is printed.

    There the X^4 coefficient is printed as +0.0975 where the general form gives -0.0975. The sign is a slip: the
    general form is what the contact problem gives at a fixed contact radius. Everybody uses (12), so nu = 0.5
    takes it and any other nu the general form; at X = 0.75 that is a step of 2 % in force.
    """
    nu = contact.layer.nu
    if nu == 0.5:
        return PolynomialFactor((1.0, 1.133, 1.283, 0.769, 0.0975))
    alpha = -(1.2876 - 1.4678 * nu + 1.3442 * nu**2) / (1.0 - nu)
    beta = (0.6387 - 1.0277 * nu + 1.5164 * nu**2) / (1.0 - nu)
    return dimitriadis_expansion(alpha, beta)


def _dimitriadis_unbonded(contact: LayerContact) -> PolynomialFactor:
    """The layer that slips; at nu = 0.5 the coefficients round to those of the source's equation (11)."""
    nu = contact.layer.nu
    alpha = -0.347 * (3.0 - 2.0 * nu) / (1.0 - nu)
    beta = 0.056 * (5.0 - 2.0 * nu) / (1.0 - nu)
    return dimitriadis_expansion(alpha, beta)


def _gavara_cone(_contact: LayerContact) -> PolynomialFactor:
    """1 + 1.7795 (2 tan(alpha)/pi^2) d/h + 16 1.7795^2 tan(alpha)^2 (d/h)^2, as printed.

    Both terms are far from the exact contact problem: the linear one is half of the exact 4 a_0 tan(alpha)/pi^2,
    with a_0 the kernel's first moment, and the quadratic one, for lack of a 1/pi^4, about 78 times too large.
    """
    return PolynomialFactor((1.0, 2.0 * 1.7795 / np.pi**2, 16.0 * 1.7795**2))


def _managuli_cone(_contact: LayerContact) -> PolynomialFactor:
    """1 + 4 C d/h + 20 C^2 (d/h)^2, C = 1.7795 tan(alpha)/pi^2."""
    C = 1.7795 / np.pi**2
    return PolynomialFactor((1.0, 4.0 * C, 20.0 * C**2))


@dataclass(frozen=True)
class _LongFactor(Factor):
    """(1 + 1.15 X + a w + b w^2)/(1 + 2.3 w), w = X^3: a fit to neo-Hookean calculations with a true sphere.

    Against linear elasticity and a paraboloid the branch for R/h > 2 is within 2 % up to X = 0.75; the other one
    is up to 33 % lower at the source's largest depths, where d is as large as R. The two branches differ by up to
    9 % where they meet, at R/h = 2.
    """

    a: float
    b: float

    @classmethod
    def of(cls, contact: LayerContact) -> _LongFactor:
        if contact.radius_ratio > 2.0:
            return cls(9.5, 4.212)
        thickness_ratio = 1.0 / contact.radius_ratio
        return cls(
            10.05 - 0.63 * np.sqrt(thickness_ratio) * (3.1 + thickness_ratio**2),
            4.8 - 4.23 * thickness_ratio**2,
        )

    def value(self, u: FloatArray) -> FloatArray:
        w = u**3
        return np.asarray((1.0 + 1.15 * u + self.a * w + self.b * w * w) / (1.0 + 2.3 * w))


# Where Hermanowicz's two fits meet, l = X^2 = 0.4; the thick one's factor in powers of X, and G of the thin one.
_SWITCH = np.sqrt(0.4)
_THICK = (1.0, 1.10534, 1.60675, 1.60183)
_THIN = (0.61579, -3.11432, 6.69297, -7.17028, 8.22767, 0.0, 0.5 * np.pi)


@dataclass(frozen=True)
class _HermanowiczFactor(Factor):
    """P = E/(1-nu^2) (h^3/R) G(X): minimax fits to the exact contact problem, joined to the thin-layer limit.

    At the switch the force is 0.082 % above the exact one from below and 0.052 % from above.
    """

    @classmethod
    def of(cls, _contact: LayerContact) -> _HermanowiczFactor:
        return cls()

    def value(self, u: FloatArray) -> FloatArray:
        thin = np.maximum(u, _SWITCH)
        return np.where(
            u < _SWITCH,
            polynomial.polyval(u, _THICK),
            0.75 * polynomial.polyval(thin, _THIN) / thin**3,
        )


# --- spheres on an elastic base --------------------------------------------------------------------------


@dataclass(frozen=True)
class _CliffordFactor(Factor):
    """1 + contrast P x^n/(1 + P x^n), P = 2.25, n = 1.5, x = scale X: a fit to finite elements.

    E* is E/(1 - nu^2), so that a small contact gives Hertz's law of the layer; the ratio inside x is that of
    Young's moduli. With E* read as Young's modulus the force of the smallest contact would be too small by 1 -
    nu_L^2.
    """

    contrast: float
    scale: float

    @classmethod
    def of(cls, contact: LayerContact) -> _CliffordFactor:
        layer, base = contact.layer, contact.elastic_base
        poisson = (1.0 - 0.22 * base.nu**2) / (1.0 - 1.92 * layer.nu**2)
        scale = (layer.E / base.E) ** (2.0 / 3.0) * poisson
        return cls(contact.reduced_modulus_ratio - 1.0, scale)

    def value(self, u: FloatArray) -> FloatArray:
        weight = 2.25 * (self.scale * u) ** 1.5
        return np.asarray(1.0 + self.contrast * weight / (1.0 + weight))


@dataclass(frozen=True)
class _DossFactor(Factor):
    """(q + 1)/(q s^A + 1), s = E_L/E_S, q = 0.85 X + 3.36 X^2, A = min(1, 0.72 - 0.34 X + 0.51 X^2).

    A fit to finite elements. The exponent stops at 1, reached at X = 1.146: from there a very large contact feels
    the base alone; the stiffness has a small step at that depth.
    """

    softness: float

    @classmethod
    def of(cls, contact: LayerContact) -> _DossFactor:
        return cls(contact.layer.E / contact.elastic_base.E)

    def value(self, u: FloatArray) -> FloatArray:
        q = 0.85 * u + 3.36 * u * u
        exponent = np.minimum(1.0, 0.72 - 0.34 * u + 0.51 * u * u)
        return np.asarray((q + 1.0) / (q * self.softness**exponent + 1.0))


# --- flat punches on a film on an elastic base -----------------------------------------------------------


def _gao_weights(contact: LayerContact) -> tuple[float, float]:
    """Weight of the film, phi_0 from 0 (base alone) to 1 (film alone), and the composite Poisson's ratio nu.

    phi_0 = (2/pi) atan x + [(1-2 nu) x ln(1 + 1/x^2) - x/(1+x^2)]/(2 pi (1-nu)),  x = h/a,
    nu = 1 - (1-nu_s)(1-nu_f)/[1 - (1-phi_1) nu_f - phi_1 nu_s], phi_1 = (2/pi) atan x + (x/pi) ln(1 + 1/x^2).
    """
    x = 1.0 / contact.radius_ratio
    nu_film, nu_base = contact.layer.nu, contact.elastic_base.nu
    angle = 2.0 / np.pi * np.arctan(x)
    logarithm = x * np.log1p(1.0 / x**2)
    phi_1 = angle + logarithm / np.pi
    nu = 1.0 - (1.0 - nu_base) * (1.0 - nu_film) / (1.0 - (1.0 - phi_1) * nu_film - phi_1 * nu_base)
    phi_0 = angle + ((1.0 - 2.0 * nu) * logarithm - x / (1.0 + x**2)) / (2.0 * np.pi * (1.0 - nu))
    return float(phi_0), float(nu)


def _gao_punch(contact: LayerContact) -> ConstantFactor:
    """E' = E'_s + (E'_f - E'_s) phi_0 over E'_f, E' = E/(1 - nu^2): a perturbation of first order in the contrast.

    Written as most users write it, with the reduced moduli mixed by phi_0. With equal Poisson's ratios the
    composite nu is theirs. Good for moduli that differ by a factor of two.
    """
    film, _ = _gao_weights(contact)
    base_ratio = contact.reduced_modulus_ratio
    return ConstantFactor(base_ratio + (1.0 - base_ratio) * film)


def _hay_punch(contact: LayerContact) -> ConstantFactor:
    """Springs in series and in parallel: 1/mu_c = (1 - phi_0)/(mu_s + F phi_0 mu_f) + phi_0/mu_f, F = 0.0626.

    E'_c = 2 mu_c/(1 - nu_c), with phi_0 and nu_c of Gao, Chiu and Lee, and the shear moduli mu. The fitted F does
    not vanish with the contrast: film and base of one material still give a force that is up to 2 % too large.
    """
    film, nu = _gao_weights(contact)
    mu_film, mu_base = _shear_modulus(contact.layer), _shear_modulus(contact.elastic_base)
    compliance = (1.0 - film) / (mu_base + 0.0626 * film * mu_film) + film / mu_film
    reduced_modulus = 2.0 / ((1.0 - nu) * compliance)
    return ConstantFactor(reduced_modulus / (2.0 * contact.layer.theta))


def _shear_modulus(material: Material) -> float:
    return material.E / (2.0 * (1.0 + material.nu))


_FORMULAS: Mapping[str, Formula] = {
    "dimitriadis2002": _dimitriadis_bonded,
    "dimitriadis2002-unbonded": _dimitriadis_unbonded,
    "gavara2012": _gavara_cone,
    "managuli2018": _managuli_cone,
    "long2011": _LongFactor.of,
    "hermanowicz2021": _HermanowiczFactor.of,
    "clifford2009": _CliffordFactor.of,
    "doss2019": _DossFactor.of,
    "gao1992": _gao_punch,
    "hay2011": _hay_punch,
}
