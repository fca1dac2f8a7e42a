"""What is refused of a test on a draining layer, and what is said beside its answer, with the number."""

from __future__ import annotations

import numpy as np

from underlay._arrays import FloatArray, positive
from underlay.errors import InputError, RangeError
from underlay.mechanics.biphasic.history import Polyline
from underlay.mechanics.body import Body, Layer, Rigid
from underlay.quantities import Part

# Points after the ramp below which nothing of the fall is seen.
_FEWEST = 5
# Time (a^2/c) at which the plateau is reached well enough for E, nu and k not to correlate: on thick layers later.
_LONG_ENOUGH, _LONG_ENOUGH_THICK, _THIN = 1.0, 3.0, 0.25
# In the hold of a depth-controlled test the depth stands and the force falls; in creep it is the other way round.
_STANDS = 0.02


def checked_thickness(thickness: float) -> float:
    """Return the layer's thickness (m), or infinity for a half-space, after checking it.

    Raises
    ------
    InputError
        If it is not positive.
    """
    return np.inf if thickness == np.inf else positive(thickness, "layer thickness", "m")


def check_effects(
    layer: Layer, substrate: Body | None, adhesion: Part | None, history: Part | None, discrepant: bool
) -> None:
    """Refuse combinations of a draining layer with other effects that are not simulated.

    Raises
    ------
    InputError
        If its base is not rigid and bonded, or there is adhesion, another history, stiffening, sides, a relaxation
        that is no Prony series or a discrepancy of the law.
    """
    if substrate is not None and not isinstance(substrate, Rigid):
        raise InputError(
            "a draining layer is simulated on a rigid base that lets no water through, or as a half-space: make "
            "the base rigid, or the layer elastic"
        )
    if layer.bond != "bonded" and substrate is not None:
        raise InputError(f"a draining layer is simulated bonded to its base; got bond = {layer.bond!r:.40}")
    if adhesion is not None:
        raise InputError(
            f"a draining layer is simulated without adhesion; got {adhesion!r:.60}: leave out adhesion or drainage"
        )
    for given, what in (
        (history is not None, "a history"),
        (layer.linear is not layer, "stiffening or sides"),
        (
            layer.relaxation is not None and not layer.relaxation.bounded,
            "a relaxation without a modulus at once",
        ),
        (discrepant, "a discrepancy of the law"),
    ):
        if given:
            raise InputError(f"a draining layer beside {what} is not simulated: leave one of them out")


def checked_hold(time: FloatArray, ramp_end: float) -> int:
    """Count the points of a record (times in s, (n,)) after the ramp ends at `ramp_end` (s).

    Raises
    ------
    InputError
        If there are fewer than five, too few to show the fall of the force.
    """
    after = int((time > ramp_end).sum())
    if after < _FEWEST:
        raise InputError(
            f"a draining layer shows in the hold: the record has {after} points after the ramp ends at "
            f"{ramp_end:.6g} s, and at least {_FEWEST} are needed"
        )
    return after


def refuse_load_control(depth: FloatArray, force: FloatArray, held: slice) -> None:
    """Refuse a creep test, in whose hold the force is constant, where a relaxation test is expected.

    Raises
    ------
    InputError
        If over the points `held` the force (N) changes by less than 2 % and the depth (m) by more.
    """
    moved = float(np.ptp(depth[held]) / np.abs(depth[held]).max())
    fell = float(np.ptp(force[held]) / np.abs(force[held]).max())
    if fell < _STANDS < moved:
        raise InputError(
            f"in the hold the force changes by {100 * fell:.2g} % and the depth by {100 * moved:.2g} %: this is a "
            "creep test under load control; fit its depth under the load, not its force"
        )


def checked_contact(depth: Polyline, thickness: float, ripple: float) -> float:
    """Return the largest depth (m) of a rounded tip's history, after checking that the depth never falls back.

    Raises
    ------
    InputError
        If the depth falls back by more than the share `ripple` of its largest: the contact would open.
    RangeError
        If the tip goes as deep as the layer is thick: strains are not small.
    """
    deepest = float(depth.value.max())
    if not deepest > 0.0:
        raise InputError(f"the tip never touches: its largest depth is {deepest:.6g} m")
    back = float((np.maximum.accumulate(depth.value) - depth.value).max())
    if back > ripple * deepest:
        raise InputError(
            f"the depth falls back by {back:.3g} m of {deepest:.3g} m: how the contact of a rounded tip opens on a "
            "draining layer is not simulated; end the record before the withdrawal"
        )
    if deepest >= thickness:
        raise RangeError(
            f"a depth of {deepest:.3g} m in a layer {thickness:.3g} m thick is no small strain: keep below its "
            "thickness",
            max_depth=thickness,
        )
    return deepest


def hold_doubt(hold: float, unit_time: float, eps: float) -> str:
    """Warning that a hold ends before the force has levelled off; "" where it does not.

    `hold` is its duration (s), `unit_time` the fitted drainage time a^2/c (s), `eps` contact radius over thickness.
    """
    reached = hold / unit_time
    wanted = _LONG_ENOUGH if eps >= _THIN else _LONG_ENOUGH_THICK
    if reached >= wanted:
        return ""
    return (
        f"the hold ends at {reached:.2g} a^2/c, before the plateau (at {wanted:g}): E, nu and permeability are "
        f"known together only; hold for {wanted * unit_time:.3g} s"
    )


def ramp_doubt(ramp: float, unit_time: float) -> str:
    """Warning that a ramp (s) lasts longer than the drainage time a^2/c, `unit_time` (s); "" where it does not."""
    if ramp <= unit_time:
        return ""
    return (
        f"the ramp lasts {ramp / unit_time:.2g} a^2/c: the undrained peak is not seen, and nu (or the in-plane "
        f"modulus) comes from the tail alone; ramp within {unit_time:.3g} s"
    )


def peak_doubt(peak: float, largest: float) -> str:
    """Warning that the force ratio `peak` over equilibrium exceeds the `largest` of an isotropic layer; or ""."""
    if peak <= largest:
        return ""
    return (
        f"the peak is {peak:.3g} times the equilibrium force, and no isotropic draining layer gives more than "
        f"{largest:.3g} on this ramp: stiffer in plane than along the axis, transversely isotropic"
    )


def anisotropy_doubt(nu: float | None = None, modulus_ratio: float | None = None) -> str:
    """Warning that a fit ended at a Poisson's ratio below 0.02, or at E/E_axial above 30; "" where it did not."""
    if nu is not None and nu < 0.02:
        return (
            f"nu = {nu:.3g} is at the end of what an isotropic layer can be: try a transversely isotropic one"
        )
    if modulus_ratio is not None and modulus_ratio > 30.0:
        return f"E/E_axial = {modulus_ratio:.3g} is more than cartilage has (5 to 20): check thickness and drainage"
    return ""
