"""The modulus as a function of depth, from a fit or from a problem that is fitted first."""

from __future__ import annotations

from underlay._given import require_given
from underlay.inference.least_squares.fit_result import Fit
from underlay.inference.least_squares.fitting import fit as least_squares_fit
from underlay.inference.pointwise.modulus import modulus_by_depth
from underlay.inference.pointwise.result import PointwiseModulus
from underlay.inference.problem import Problem


def pointwise_modulus(
    result: Fit | Problem, *, curve: int = 0, points: int = 30, level: float = 0.95
) -> PointwiseModulus:
    """Compute the modulus of the layer separately at every depth of a curve.

    It is the fit's modulus, times the ratio of the elastic moduli by which data and fitted model are reproduced
    there. For an elastic sample that is the modulus by which the force is reproduced; what a sample with memory has
    relaxed by then is in both.

    Parameters
    ----------
    result : Fit or Problem
        Gives contact point, baseline and everything but the layer's modulus; a problem is fitted first.
    curve : int, default 0
        Which curve of a joint fit.
    points : int, default 30
        Largest number of depths; each uses eight points of the curve or more.
    level : float, default 0.95
        Confidence of the intervals. They include the noise of the points about each depth and the uncertainty of
        the fitted parameters, under the noise that `Fit.interval` assumes.

    Returns
    -------
    PointwiseModulus
        Depths at which the interval is narrower than twice the modulus, which excludes the first after contact.

    Raises
    ------
    InputError
        If the tip adheres, or the curve is not one of the fit.
    CurveError
        If the modulus is determined at no depth.

    Examples
    --------
    >>> import numpy as np, underlay as ul
    >>> scene = ul.Scene(ul.Paraboloid(1e-3), ul.Layer(ul.Isotropic(1e6, 0.45), 5e-4), ul.RIGID)
    >>> curve = ul.synthesize(scene, np.linspace(0.0, 1e-4, 400), ul.Noise(force=1e-4), rng=0)
    >>> fit = ul.fit(ul.Problem(scene, curve, {"layer.E": (1e4, 1e8)}, noise=ul.Noise(force=1e-4)))
    >>> found = ul.pointwise_modulus(fit)
    >>> bool(np.all(np.abs(found.apparent.modulus[10:] / 1e6 - 1.0) < 0.01))
    True
    >>> bool(found.apparent_halfspace.modulus[-1] > 2e6)
    True
    """
    require_given(result, "result", Fit, Problem)
    fit = least_squares_fit(result) if isinstance(result, Problem) else result
    return modulus_by_depth(fit, curve=curve, points=points, level=level)
