"""A sphere on a thin layer on a rigid base, as a model for nanite and PyJibe.

The force is underlay's exact solution of the contact problem, not a correction factor: the layer, of Young's
modulus E, Poisson's ratio nu and known thickness, is bonded to a rigid base (a cell or a gel on glass). In nanite:

    from nanite.model import load_model_from_file
    load_model_from_file("model_underlay_layer.py", register=True)
    test.fit_model(model_key="underlay_layer", ...)

PyJibe, which fits with nanite, takes the same file among its extensions. Both need underlay in their environment.
"""

import lmfit
import numpy as np

import underlay as ul

# The law follows from the numbers without noise of its own: its error stays below what a fit's last step asks for.
_LAW = ul.Exact(rtol=1e-9)


def get_parameter_defaults():
    """Return the default model parameters."""
    params = lmfit.Parameters()
    params.add("E", value=3e3, min=1e-3)
    params.add("R", value=10e-6, min=1e-9, vary=False)
    params.add("nu", value=0.5, min=0, max=0.5, vary=False)
    params.add("thickness", value=10e-6, min=1e-9, vary=False)
    params.add("contact_point", value=0)
    params.add("baseline", value=0)
    return params


def layer_on_rigid_base(delta, E, R, nu, thickness, contact_point=0, baseline=0):
    r"""Sphere on a layer bonded to a rigid base: the exact contact problem.

    Parameters
    ----------
    delta: 1d ndarray
        Indentation [m]
    E: float
        Young's modulus of the layer [N/m²]
    R: float
        Tip radius [m]
    nu: float
        Poisson's ratio of the layer
    thickness: float
        Thickness of the layer [m]
    contact_point: float
        Indentation offset [m]
    baseline: float
        Force offset [N]

    Returns
    -------
    F: float
        Force [N]

    Notes
    -----
    These approximations are made:

    - The layer is isotropic and linearly elastic.
    - The layer is bonded to a base that does not deform.
    - There is no friction and no adhesion under the tip.
    - The indenter is a true sphere that does not deform.
    """
    root = contact_point - delta
    # Not the deepest point of this guess: the law must not change with the contact point.
    deepest = max(float(np.ptp(delta)), float(root.max()))
    try:
        law = _law(R, nu, thickness, deepest)
    except ul.RangeError as error:
        if error.max_depth is None:
            raise
        # A step of the search may go deeper than the sphere is high: the force goes on by its tangent, so that
        # the search finds back. No result lies there: the tip would be buried.
        deepest = error.max_depth * (1 - 1e-9)
        law = _law(R, nu, thickness, deepest)
    # On a rigid base the force is proportional to E.
    beyond = np.maximum(root - deepest, 0.0)
    return E * (law.force(np.minimum(root, deepest)) + law.stiffness(deepest) * beyond) + baseline


def _law(R, nu, thickness, deepest):
    layer = ul.Layer(ul.Isotropic(1.0, nu), thickness)
    return ul.contact_law(ul.Sphere(R), layer, ul.RIGID, max_depth=deepest, solver=_LAW)


model_doc = layer_on_rigid_base.__doc__
model_func = layer_on_rigid_base
model_key = "underlay_layer"
model_name = "sphere on a layer on a rigid base (underlay)"
parameter_keys = ["E", "R", "nu", "thickness", "contact_point", "baseline"]
parameter_names = [
    "Young's Modulus",
    "Tip Radius",
    "Poisson's Ratio",
    "Layer Thickness",
    "Contact Point",
    "Force Baseline",
]
parameter_units = ["Pa", "m", "", "m", "m", "N"]
valid_axes_x = ["tip position"]
valid_axes_y = ["force"]
