"""Master curves of a paraboloid on every isotropic layer on an isotropic base, solved once and kept in a file.

A search for a start asks little accuracy of laws far apart: the first fit of a process would spend more on solving
for them than on fitting. Without friction such a body is two numbers and no more (as Dundurs found of plane strain;
its Hankel transform sees no other): the ratio r = theta_base/theta_layer of the elastic constants, and

    share = (2 (r gamma_layer - gamma_base) + 1)/(r + 1),   gamma = (1 - 2 nu)/(2 (1 - nu)),

which goes from 0 to 1 while Poisson's ratios nu go from 1/2 to 0. The logarithms of the three factors are Chebyshev
series in ln r, in ln(1 + 100 share), which spreads what thin incompressible layers crowd at zero, and in the
stretched varpi. `tests/studies/stored_curves.py` writes the file; a test solves again.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, log, log1p
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from underlay._arrays import FloatArray, read_only
from underlay.errors import LawError
from underlay.mechanics.body import PlaneConstants, isotropic_constants
from underlay.mechanics.exact.master_curve import Stretch, chebyshev_angles, chebyshev_coefficients
from underlay.mechanics.exact.nodes import TABLES, Resolution
from underlay.mechanics.kernel import Kernel, LayerKernel
from underlay.mechanics.kernel.substrate import is_isotropic

__all__ = ["EXPONENT", "FILE", "STORED_ERROR", "TOP", "StoredCurves", "StoredSeries", "grid", "stored_curves"]

FILE = Path(__file__).with_name("stored_curves.npy")
#: Relative error of the three factors: what the series leave out, at most 1.8e-4 of 150 random bodies, and as much
#: again; the largest is that of the softest bases.
STORED_ERROR = 3e-4
#: The tip's exponent, and the largest varpi.
EXPONENT, TOP = 2.0, 10.48
# Of the stretched varpi; of the share; ln r; terms in ln r, share and varpi.
_SOFTNESS, _CROWDING = 4.0, 100.0
_LOG_RATIOS = (log(0.004), log(470.0))
_TERMS = (18, 12, 28)
_MADE_FOR = (EXPONENT, TOP, _SOFTNESS, _CROWDING, *_LOG_RATIOS, *_TERMS)
_STRETCH = Stretch.to(TOP, _SOFTNESS)
# Rounding of constants, and of the ends.
_ROUNDING = 1e-9


class StoredSeries(NamedTuple):
    """Curves of some bodies.

    Parameters
    ----------
    coefficients : ndarray (bodies, terms, 3)
        Chebyshev coefficients in the stretched varpi.
    resolution : Resolution
        Nodes of the finest solution behind the file.
    radii : int
        Contact radii behind it.
    """

    coefficients: FloatArray
    resolution: Resolution
    radii: int

    @property
    def stretch(self) -> Stretch:
        """The stretched variable in which varpi is expanded."""
        return _STRETCH

    def logarithms(self, varpi: FloatArray) -> FloatArray:
        """Logarithms of the three factors at `varpi` (n,), shape (bodies, 3, n)."""
        z = self.stretch.z(varpi)
        return np.asarray(np.swapaxes(self.coefficients, 1, 2) @ _polynomials(z, _TERMS[2]).T)


class StoredCurves(NamedTuple):
    """The stored curves as the file holds them.

    Parameters
    ----------
    made_for : ndarray
        Numbers that the reader must share.
    series : ndarray (ratios + 1, shares, terms, 3)
        Chebyshev coefficients in ln r, in the share and in varpi; the last entry is a rigid base's.
    nodes : ndarray (4,)
        `Resolution` of the finest solution behind them.
    """

    made_for: FloatArray
    series: FloatArray
    nodes: FloatArray

    @classmethod
    def through(cls, values: FloatArray, nodes: FloatArray) -> Self:
        """Expand logarithms (ratios + 1, shares, terms, 3) at the points of `grid`."""
        count, shares, terms, _ = values.shape
        on_base = np.tensordot(_expansion(count - 1), values[:-1], 1)
        both = np.concatenate((on_base, values[-1:]))
        series = np.einsum("su,tv,ruvf->rstf", _expansion(shares), _expansion(terms), both)
        return cls(np.array(_MADE_FOR), np.asarray(series), nodes)

    @classmethod
    def read(cls) -> Self:
        """Read the file.

        Raises
        ------
        LawError
            If it was made for something else.
        """
        kept = np.load(FILE, allow_pickle=False)
        if kept.dtype.names != cls._fields or tuple(kept["made_for"].tolist()) != _MADE_FOR:
            raise LawError(
                f"{FILE} does not hold the curves that this version reads: install underlay again or, in its tree, "
                "run python tests/studies/stored_curves.py"
            )
        return cls(*(read_only(kept[name].astype(np.float64)) for name in cls._fields))

    def write(self) -> None:
        """Write the file; single precision is a thousand times finer than the series."""
        kept = self._replace(series=self.series.astype(np.float32))
        named = list(zip(self._fields, kept, strict=True))
        record = np.zeros((), dtype=[(name, part.dtype, part.shape) for name, part in named])
        for name, part in named:
            record[name] = part
        np.save(FILE, record, allow_pickle=False)

    def of(self, places: Sequence[tuple[float, float]]) -> StoredSeries:
        """Curves of bodies at their places, each in [-1, 1]; the first is infinite on a rigid base."""
        first, second = np.array(places).T
        rigid = np.isinf(first)
        rows = np.zeros((len(places), len(self.series)))
        rows[rigid, -1] = 1.0
        rows[~rigid, :-1] = _polynomials(first[~rigid], _TERMS[0])
        series = np.tensordot(rows, self.series, 1)
        radial, wavenumbers, scale, reach = self.nodes.tolist()
        return StoredSeries(
            np.einsum("bs,bstf->btf", _polynomials(second, _TERMS[1]), series),
            Resolution(int(radial), int(wavenumbers), scale, reach),
            self.series[:, :, :, 0].size,
        )


def stored_curves(bodies: Sequence[Kernel], exponent: float, top: float, rtol: float) -> StoredSeries | None:
    """Curves of a power-law tip on bodies under a layer of unit thickness.

    Parameters
    ----------
    bodies : sequence of Kernel
        With the layer.
    exponent : float
        Of the tip's power law.
    top : float
        Largest varpi that will be asked for.
    rtol : float
        Relative error allowed.

    Returns
    -------
    StoredSeries or None
        None where the file does not hold all of them so well.
    """
    if exponent != EXPONENT or top > TOP * (1.0 + _ROUNDING) or rtol < STORED_ERROR:
        return None
    places = [_place(body) for body in bodies]
    if any(place is None or abs(place[1]) > 1.0 for place in places):
        return None
    stored = TABLES.get(("stored curves",), StoredCurves.read)
    return stored.of([place for place in places if place is not None])


def grid() -> tuple[list[list[LayerKernel]], FloatArray]:
    """Bodies (ratios + 1, shares) and varpi (terms,) that the file is solved for."""
    log_ratios, spread, z = (np.cos(chebyshev_angles(count)) for count in _TERMS)
    low, high = _LOG_RATIOS
    ratios = np.exp(0.5 * (low + high) + 0.5 * (high - low) * log_ratios).tolist()
    shares = (np.expm1(0.5 * (spread + 1.0) * log1p(_CROWDING)) / _CROWDING).tolist()
    bodies = [[_body(ratio, share) for share in shares] for ratio in (*ratios, inf)]
    return bodies, _STRETCH.v(z)


def _body(ratio: float, share: float) -> LayerKernel:
    """One of the bodies of a ratio and a share: gamma is half the share in the layer, what is left in the base."""
    halves = (0.5 * share, 0.5 * (1.0 - share))
    layer, base = (isotropic_constants(1.0, (1.0 - 2.0 * part) / (2.0 - 2.0 * part)) for part in halves)
    if np.isinf(ratio):
        return LayerKernel(layer, None)
    # Isotropic constants of another modulus: compliances and stiffness scale.
    stiffer = float(ratio * layer.theta / base.theta)
    return LayerKernel(layer, PlaneConstants(base.q, base.c / stiffer, base.g * stiffer, base.S / stiffer))


def _place(body: Kernel) -> tuple[float, float] | None:
    """Where a body stands in both series: infinite on a rigid base, None where it has no place."""
    if not (isinstance(body, LayerKernel) and is_isotropic(body.layer)):
        return None
    layer, base = body.layer, body.base
    if base is None:
        return inf, _spread(2.0 * layer.coupling)
    if not is_isotropic(base):
        return None
    ratio = float(base.theta / layer.theta)
    low, high = _LOG_RATIOS
    first = 2.0 * (log(ratio) - low) / (high - low) - 1.0
    share = (2.0 * (ratio * layer.coupling - base.coupling) + 1.0) / (ratio + 1.0)
    return None if abs(first) > 1.0 else (first, _spread(share))


def _spread(share: float) -> float:
    """Place of a share in its series; beyond it where a Poisson's ratio is negative."""
    if not -_ROUNDING <= share <= 1.0 + _ROUNDING:
        return inf
    return 2.0 * log1p(_CROWDING * min(max(share, 0.0), 1.0)) / log1p(_CROWDING) - 1.0


def _polynomials(place: FloatArray, count: int) -> FloatArray:
    """Chebyshev polynomials (n, count) at places (n,) in [-1, 1]."""
    angle = np.arccos(np.minimum(place, 1.0))
    return np.asarray(np.cos(np.multiply.outer(angle, np.arange(count))))


def _expansion(count: int) -> FloatArray:
    """Matrix (count, count) from values at the Chebyshev points to coefficients."""
    return chebyshev_coefficients(np.eye(count), chebyshev_angles(count))
