"""The layer modulus at which the contact law gives a measured force, or a measured stiffness, at a depth.

Every modulus of the layer is multiplied by one factor, the share, their ratios kept. Where the layer's are the only
moduli of the sample, the force P(w) at the depth w and dP/dw (Argatov and Sabina, 9.1) are proportional to the
share. On an elastic base they are not, and the share is interpolated between the laws of a ladder of shares.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import interpolate

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.forward import Forward
from underlay.inference.model.laws import LawStore
from underlay.mechanics.body import Layer
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.solver import Solver
from underlay.scene.instrument import Chain
from underlay.scene.scene import Scene

# Factor to which the shares of the ladder reach to both sides, and how many there are. ln P is a smooth function of
# ln share; a cubic through rungs ln 30 / 8 apart is within 2e-5 of it, one of ln dP/dw within 5e-5
# (test_pointwise.py holds both).
_REACH, _RUNGS = 30.0, 17


class Explained(NamedTuple):
    """Layer moduli (Pa) that reproduce n measured forces and stiffnesses, and their sensitivity.

    NaN where no modulus of the range that is tried reproduces them.

    Parameters
    ----------
    apparent, incremental : FloatArray
        Modulus (Pa) from the force P and from the stiffness S = dP/dw, w the depth, (n,).
    apparent_power, incremental_power : FloatArray
        d ln(modulus) / d ln(P), and d ln(modulus) / d ln(S), (n,).
    """

    apparent: FloatArray
    incremental: FloatArray
    apparent_power: FloatArray
    incremental_power: FloatArray


@dataclass(frozen=True)
class Body:
    """An elastic scene whose law is inverted for the layer's modulus.

    Parameters
    ----------
    forward : Forward
        Compiled for the depths at which it is evaluated.
    moduli : tuple of str
        Paths of the layer's moduli.
    proportional : bool
        Whether they are the only moduli of the sample, so that the force is proportional to them.
    """

    forward: Forward
    moduli: tuple[str, ...]
    proportional: bool

    @classmethod
    def of(
        cls,
        scene: Scene,
        depth: FloatArray,
        free: tuple[str, ...],
        solver: Solver,
    ) -> Body:
        """Compile `scene` without its memory for depth readings (m), (n,), where the paths `free` vary."""
        elastic = scene.elastic
        known = elastic.quantities
        moduli = tuple(p for p in known if p.startswith("layer.") and known[p].scales == "force")
        others = [
            p
            for p in known
            if p not in moduli
            and p.startswith(("layer.", "substrate."))
            and known[p].kind in ("pressure", "stiffness per area")
        ]
        paths = tuple(dict.fromkeys((*moduli, *(p for p in free if p in known))))
        forward = Forward.compile(elastic, depth, paths, solver, LawStore())
        return cls(forward, moduli, not others)

    def explain(self, values: Mapping[str, float], force: FloatArray, slope: FloatArray) -> Explained:
        """Layer moduli that reproduce force readings and their slopes, each (n,).

        Parameters
        ----------
        values : mapping of str to float
            Every number of the scene (SI).
        force, slope : FloatArray
            Force readings (N) and their derivative along the depth readings (N/m).

        Raises
        ------
        InputError
            If these are no values of a possible scene, or its law does not reach as deep.
        """
        contact = self.contact(values, force, slope)
        E = values["layer.E"]
        if self.proportional:
            P, S = self._law(values, 1.0, contact.depth).force_and_stiffness(contact.depth)
            ones = np.ones_like(P)
            return Explained(E * _ratio(contact.force, P), E * _ratio(contact.stiffness, S), ones, ones)
        log_shares = np.linspace(-np.log(_REACH), np.log(_REACH), _RUNGS)
        rungs = [
            self._law(values, float(share), contact.depth).force_and_stiffness(contact.depth)
            for share in np.exp(log_shares)
        ]
        P, S = (np.array(column) for column in zip(*rungs, strict=True))
        apparent, apparent_power = _looked_up(P, contact.force, log_shares)
        incremental, incremental_power = _looked_up(S, contact.stiffness, log_shares)
        return Explained(E * np.exp(apparent), E * np.exp(incremental), apparent_power, incremental_power)

    def contact(self, values: Mapping[str, float], force: FloatArray, slope: FloatArray) -> Contacts:
        """Tip depth (m), contact force (N) and stiffness dP/dw (N/m), each (n,), from force readings and slopes.

        `force` (N) and `slope` (N/m) are (n,), `values` all numbers of the scene (SI) by path.
        """
        chain, depth = Chain.of(values), self.forward.depth
        compliance = 0.0 if chain.frame is None else chain.frame.compliance
        P = force - chain.reading(np.zeros_like(depth), depth)
        along = slope - values.get("instrument.baseline_slope", 0.0)
        # dw = dd - C dP, less what a lever bends beyond what was taken off: (sigma - 1) dF / k.
        beyond = float(self.forward.lever_compliances(values))
        travel = chain.travel(depth - beyond * force)
        return Contacts(travel - compliance * P, P, along / (1.0 - beyond * slope - compliance * along))

    def reading(self, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
        """Force reading of the model (N) and its slope along the depth readings (N/m), each (n,).

        `values` are all numbers of the scene (SI) by path.
        """
        chain = Chain.of(values)
        found = self.forward.reading(values)
        share = np.ones_like(found.force) if chain.frame is None else chain.frame.share(found.stiffness)
        tilt = values.get("instrument.baseline_slope", 0.0)
        # Of a lever of spring constant k whose sensitivity is sigma times what was calibrated:
        # dF/dd = S share (1 - (sigma - 1)/k dF/dd) + tilt
        beyond = float(self.forward.lever_compliances(values))
        slope = found.stiffness * share
        return found.force, (slope + tilt) / (1.0 + beyond * slope)

    def _law(self, values: Mapping[str, float], share: float, depth: FloatArray) -> ContactLaw:
        shared = {path: share * values[path] for path in self.moduli}
        return self.forward.law({**values, **shared}, float(depth.max()))


class Contacts(NamedTuple):
    """Tip depths (m), contact forces (N) and stiffnesses (N/m), each (n,)."""

    depth: FloatArray
    force: FloatArray
    stiffness: FloatArray


def halfspace_of(scene: Scene) -> Scene:
    """Return the scene with the layer made infinitely thick: what a half-space formula assumes."""
    layer = Layer(scene.layer.material, relaxation=scene.layer.relaxation)
    return Scene(
        scene.indenter,
        layer,
        None,
        scene.instrument,
        scene.history,
        adhesion=scene.adhesion,
        lever=scene.lever,
    )


def _ratio(measured: FloatArray, by_law: FloatArray) -> FloatArray:
    """Quotient (n,); nan before contact, where the law has no force that a modulus could scale."""
    return np.divide(measured, by_law, out=np.full_like(by_law, np.nan), where=by_law > 0.0)


def _looked_up(
    rungs: FloatArray, targets: FloatArray, log_shares: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """ln of the share at which each column of computed values reaches its target, by interpolation.

    The share is the factor on the layer's moduli.

    Parameters
    ----------
    rungs : FloatArray
        Forces or stiffnesses by the laws of the ladder, (laws, n).
    targets : FloatArray
        Measured ones, (n,).
    log_shares : FloatArray
        ln of the share of each law, (laws,).

    Returns
    -------
    tuple of FloatArray
        ln share, and d ln share / d ln target, (n,); NaN where the ladder does not reach the target.
    """
    found, power = np.full(len(targets), np.nan), np.full(len(targets), np.nan)
    for n, target in enumerate(targets):
        column = rungs[:, n]
        if not (target > 0.0 and column[0] > 0.0 and (np.diff(column) > 0.0).all()):
            continue
        if not column[0] <= target <= column[-1]:
            continue
        curve = interpolate.CubicSpline(np.log(column), log_shares)
        found[n], power[n] = curve(np.log(target)), curve(np.log(target), 1)
    return found, power


def require_without_adhesion(scene: Scene) -> None:
    """Raise InputError for an adhesive contact: its force does not determine a modulus alone."""
    if scene.adhesion is not None:
        raise InputError(
            "the modulus depth by depth is not defined for a tip that sticks: work of adhesion and modulus would "
            "be two unknowns of one force; read the fit's own modulus"
        )
