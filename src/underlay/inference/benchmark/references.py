"""A contact law against the exact contact problem in twenty digits, and against finite elements."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from underlay._arrays import FloatArray
from underlay.errors import UnderlayError, UnderlayWarning
from underlay.inference.benchmark.cases import rows_of
from underlay.mechanics.body import RIGID, Layer
from underlay.mechanics.contact import Contact
from underlay.mechanics.indenters import Cone, FlatPunch, Indenter, Paraboloid, PowerLaw, Sphere
from underlay.mechanics.materials import Isotropic, TransverselyIsotropic
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, as_solver

__all__ = ["against_finite_elements", "against_references"]

_KINDS = {"E", "nu"}
#: Depth over thickness at which finite elements are compared.
_DEPTHS = (0.1, 0.2, 0.3)


def against_references(solver: AnySolver = "auto") -> pd.DataFrame:
    """Compare the force of a law with the references of the exact contact problem.

    Returns
    -------
    DataFrame
        One row a shape and contact radius over thickness: pairs of materials that the law took, median and largest
        size of its relative error.
    """
    law, rows = as_solver(solver), rows_of("contact_references.csv")
    found: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        found.setdefault((row["shape"], row["a/h"]), []).append(_reference_error(row, law))
    table = []
    for (shape, width), errors in found.items():
        sizes = np.abs([error for error in errors if not np.isnan(error)])
        table.append(
            {
                "shape": shape,
                "a/h": float(width),
                "pairs": f"{sizes.size} of {len(errors)}",
                "median error": float(np.median(sizes)) if sizes.size else np.nan,
                "largest error": float(sizes.max()) if sizes.size else np.nan,
            }
        )
    return pd.DataFrame(table)


def _reference_error(row: Mapping[str, str], solver: Solver) -> float:
    """Error of the force over that of one reference; NaN where the law is not for this contact."""
    radius = float(row["a/h"])
    tip, halfspace_depth = _tip(row["shape"], radius)
    # A punch goes as deep as one likes.
    depth = float(row["w/H(a)"] or 1.0) * halfspace_depth
    layer, base = _material(row["layer"]), _material(row["base"])
    contact = Contact.of(tip, Layer(layer, 1.0), base)
    force = float(row["P/(4 theta a H(a))"]) * 4.0 * contact.theta * radius * halfspace_depth
    return float(_force(solver, contact, np.array([depth]))[0]) / force - 1.0


def _force(solver: Solver, contact: Contact, depth: FloatArray) -> FloatArray:
    """Force of the solver's law at increasing depths, (n,); NaN where it is not for this contact.

    That a law is used outside its range is what is measured here, and not said again.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnderlayWarning)
            return np.asarray(solver.law(contact, float(depth[-1])).force(depth))
    except UnderlayError:
        return np.full_like(depth, np.nan)


def _tip(shape: str, radius: float) -> tuple[Indenter, float]:
    """A tip of a shape, over the layer's thickness, and H(a) at a contact radius."""
    small = 1e-3  # depths far below the thickness, so that nothing but a/h matters
    if shape == "flat punch":
        return FlatPunch(radius), small
    exponent = float(shape.removeprefix("r^"))
    coefficient = small / radius**exponent
    tips = {1.0: Cone(np.arctan(1.0 / coefficient)), 2.0: Paraboloid(0.5 / coefficient)}
    tip = tips.get(exponent, PowerLaw(exponent, coefficient))
    return tip, float(tip.abel(np.array(radius)))


def _material(cell: str) -> Any:
    if cell == "rigid":
        return RIGID
    constants = {name: float(value) for name, value in (word.split("=") for word in cell.split())}
    return Isotropic(**constants) if set(constants) == _KINDS else TransverselyIsotropic(**constants)


def against_finite_elements(solver: AnySolver = "auto") -> pd.DataFrame:
    """Compare the force of a law with finite elements of a sphere on a layer as thick as its radius.

    Linear elements show what a law lacks of the contact problem; neo-Hookean ones what linear elasticity lacks.

    Returns
    -------
    DataFrame
        One row a Poisson's ratio, material and friction under the tip: relative error of the law at three depths.
    """
    law, rows = as_solver(solver), rows_of("finite_elements.csv")
    curves: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    for row in rows:
        key = (row["nu"], row["material"], row["friction"])
        curves.setdefault(key, []).append((float(row["w/h"]), float(row["P/(E h^2)"])))
    table = []
    for (nu, material, friction), points in curves.items():
        depth, force = np.array(points).T
        contact = Contact.of(Sphere(1.0), Layer(Isotropic(1.0, float(nu)), 1.0), RIGID)
        told = _force(law, contact, depth)
        # Where the elements found no equilibrium a curve ends early.
        found = dict(zip(depth.tolist(), (told / force - 1.0).tolist(), strict=True))
        errors = {f"w/h = {w:g}": found.get(w, np.nan) for w in _DEPTHS}
        table.append({"nu": float(nu), "material": material, "friction": friction, **errors})
    return pd.DataFrame(table)
