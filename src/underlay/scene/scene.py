"""A scene, the declaration of one indentation test, and the bonds of its layers' lower faces.

An indenter is pressed into a layer on a substrate, and an instrument reads depth and force. A face is where a layer
stands on something; it may be bonded or not (`faces`, `bond_of`, `with_bond`).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay._files import write_atomic
from underlay.errors import InputError, RangeError
from underlay.mechanics.body import TIP_DRAINAGES, Base, Body, Bond, Layer, Stack
from underlay.mechanics.contact import Adhesion, Contact, laws_on
from underlay.mechanics.contact_law import ContactLaw, ScaledLaw
from underlay.mechanics.discrepancy import as_friction
from underlay.mechanics.indenters import Indenter
from underlay.mechanics.response import History, Remembered, Response, checked_times
from underlay.mechanics.solver import Solver
from underlay.mechanics.solvers import AnySolver, as_solver
from underlay.quantities import Number, Quantity, numbers_of, replace_values
from underlay.scene.discrepancy import Discrepancy
from underlay.scene.effects import effects_table
from underlay.scene.instrument import FURTHER, Instrument, Lever
from underlay.scene.parameters import unknown_parameter
from underlay.scene.scene_writer import scene_text
from underlay.scene.uncertainties import checked

# Classes of the parts of a scene, and what to give.
_PARTS: Mapping[str, tuple[Any, str]] = {
    "indenter": (Indenter, "an Indenter such as Sphere(radius)"),
    "layer": (Layer, "Layer(material, thickness)"),
    "substrate": (Body | None, "a material, rigid, a Stack or None"),
    "instrument": (Instrument, "an Instrument"),
    "adhesion": (Adhesion | None, "JKR(work), DMT(work) or None"),
    "history": (History | None, "a History or None"),
    "lever": (Lever | None, "a Lever or None"),
    "discrepancy": (Discrepancy | None, "a Discrepancy or None"),
}
# First and largest depth (m) of the law that is tried for a given force, and the largest factor between two tries.
_FIRST_DEPTH, _LAST_DEPTH, _LEAP = 1e-7, 1.0, 30.0
# Of a layer that relaxes on an elastic base: the largest tolerance of the laws of a punch, whose relaxation is
# exact (a rational function is fitted to them to 1e-8), and the share of the quasi-elastic error that the elastic
# laws may add.
_FINE, _SHARE = 1e-9, 0.1


@dataclass(frozen=True)
class Scene:
    """One indentation test, declared.

    Parameters
    ----------
    indenter : Indenter
        The tip.
    layer : Layer
        The layer that it indents.
    substrate : Isotropic, TransverselyIsotropic, RIGID or Stack, optional
        What the layer stands on: a half-space, or further layers on one. A layer of finite thickness needs one, and
        a layer on one needs a finite thickness; without a substrate the layer is a half-space and no substrate code
        runs.
    instrument : Instrument, optional
        Contact point, baseline and compliance of the instrument; ideal by default.
    history : History, optional
        A time-dependent model of the sample; without one it is elastic and no times are needed.
    adhesion : Adhesion, optional
        Adhesion between tip and surface: ``JKR(work)``, ``DMT(work)``; none by default.
    lever : Lever, optional
        A cantilever whose calibration may be wrong; without one it is taken as right.
    friction : {"unknown", "none", "stuck"}
        What is known of friction under the tip: ``"none"``, points slide freely, or ``"stuck"``, they do not slip
        where they touch. Unknown friction is computed as none, and a fit states its possible effect.
    finite_strain : bool, optional
        Whether strains are large: False says that they are not, True refuses a test for which their effect is not
        known. By default a fit states their effect, where that is known.
    discrepancy : Discrepancy, optional
        Sizes of what the law leaves out: for a posterior in which they are parameters (`free_model_error`).
    uncertainties : mapping of str to float, or "none", optional
        How well its inputs are known: half widths of 95 % intervals, by path, ``{"indenter.radius": 2e-5}`` (SI);
        of ``force``, ``depth`` and ``spring_constant`` as shares, ``{"force": 0.02}``. Zero is exact; ``"none"``
        takes every input as exact. A scene with other parts keeps the rows of the numbers that it still has.
    drainage : {"solid", "porous", "unknown"}, optional
        Whether water leaves a poroelastic layer through the tip, which must be stated for such a layer: not at all,
        or freely. Unknown drainage is computed as solid, and a fit's answers include both.

    Raises
    ------
    InputError
        If a part is of the wrong kind, a finite layer has no substrate, one on a substrate no thickness, or an
        uncertainty is of nothing that the scene has, negative or no number.

    Examples
    --------
    >>> from underlay import Isotropic, Layer, Paraboloid, RIGID, Scene
    >>> scene = Scene(Paraboloid(1e-3), Layer(Isotropic(1e6, 0.5), 1e-3), RIGID)
    >>> float(scene.force(0.0))
    0.0
    """

    indenter: Indenter
    layer: Layer
    substrate: Body | None = None
    instrument: Instrument = Instrument()
    history: History | None = None
    adhesion: Adhesion | None = None
    lever: Lever | None = None
    friction: str = "unknown"
    finite_strain: bool | None = None
    discrepancy: Discrepancy | None = None
    uncertainties: Mapping[str, float] | str | None = None
    drainage: str | None = None

    def __post_init__(self) -> None:
        for name, (kinds, wanted) in _PARTS.items():
            if not isinstance(part := getattr(self, name), kinds):
                raise InputError(f"{name} must be {wanted}; got {part!r}")
        _check_drainage(self)
        as_friction(self.friction)
        if self.finite_strain not in (None, True, False):
            raise InputError(f"finite_strain must be True, False or None; got {self.finite_strain!r:.60}")
        _check_memory(self)
        _check_sticking(self)
        _check_discrepancy(self)
        _check_on_law(self)
        if self.substrate is None and np.isfinite(self.layer.thickness):
            raise InputError(
                f"a layer {self.layer.thickness:.6g} m thick needs a substrate: say what it lies on (rigid, or "
                "a material), or leave the thickness out for a half-space"
            )
        if self.substrate is not None and not np.isfinite(self.layer.thickness):
            raise InputError(
                'a layer on a substrate needs its thickness: give layer.thickness, e.g. "1.5 mm" in a scene '
                "file, or leave the substrate out for a half-space"
            )
        if self.uncertainties is not None:
            object.__setattr__(self, "uncertainties", checked(self.uncertainties, self._numbers))

    @cached_property
    def memory(self) -> History | None:
        """Time-dependent model of the sample: relaxation or drainage of the layer, or the history; else None."""
        relaxation = self.layer.relaxation
        if self.layer.material.drains:
            from underlay.mechanics.biphasic.drainage import Drainage  # noqa: PLC0415  not for a layer without water

            return Drainage(self.indenter, self.layer, "porous" if self.drainage == "porous" else "solid")
        if relaxation is None:
            return self.history
        # Loaded only for a layer that relaxes, here and in the two methods below.
        from underlay.mechanics.viscoelastic.history import Viscoelastic  # noqa: PLC0415  see above

        return Viscoelastic(relaxation)

    @property
    def adheres(self) -> bool:
        """Whether the tip adheres: it may pull, and the way out belongs to the contact."""
        return self.adhesion is not None

    @property
    def is_elastic(self) -> bool:
        """Whether the force follows from the depth alone: nothing relaxes, drains or adheres."""
        return self.memory is None and not self.adheres

    @property
    def elastic(self) -> Scene:
        """The scene without relaxation or drainage: unrelaxed, or drained. Itself if it is elastic."""
        if self.memory is None:
            return self
        layer = replace(self.layer, material=self.layer.material.drained, relaxation=None)
        return replace(self, layer=layer, history=None, drainage=None)

    @property
    def layers(self) -> tuple[Layer, ...]:
        """Every layer, from the top down."""
        return (self.layer, *(() if self.substrate is None else self.substrate.layers))

    @property
    def base(self) -> Base | None:
        """The half-space that the layers stand on; None where the layer is itself the half-space."""
        return None if self.substrate is None else self.substrate.base

    @property
    def contact(self) -> Contact:
        """Indenter, body, friction and adhesion, as a solver takes them."""
        layer = replace(self.layer, material=self.layer.material.drained)
        contact = Contact.of(self.indenter, layer, self.substrate)
        if self.friction == "stuck":
            contact = replace(contact, friction=self.friction)
        return contact if self.adhesion is None else replace(contact, adhesion=self.adhesion)

    def contact_law(self, max_depth: float, *, solver: AnySolver = "auto") -> ContactLaw:
        """Build the law of this contact for tip depths up to `max_depth` (m); see `contact_law`."""
        contact = self.contact
        if self.discrepancy is None:
            return as_solver(solver).law(contact, max_depth)
        return self.discrepancy.law(contact, as_solver(solver), lambda one: one.law(contact, max_depth))

    def force(
        self, depth: ArrayLike, time: ArrayLike | None = None, *, solver: AnySolver = "auto"
    ) -> FloatArray:
        """Force reading (N) at depth readings `depth` (m), same shape.

        `time` (s), (n,), are the times of the readings, which a scene with relaxation or drainage needs.

        Raises
        ------
        InputError
            If a scene with relaxation or drainage has no suitable times.
        RangeError
            If the law cannot reach the deepest point.
        """
        if self.lever is not None:
            return self._through_lever(self.lever, as_finite(depth, "depth"), as_solver(solver))
        readings, chain = as_finite(depth, "depth"), self.instrument.chain
        deepest = float(chain.travel(readings).max(initial=0.0))
        law = self.contact_law(deepest, solver=solver)
        response = self.response(law)
        if self.ages:
            response = self._aged(law, as_solver(solver), chain.travel(readings), time)
        return chain.reading(response.force(chain.tip_depth(response, readings), time), readings)

    def _through_lever(self, lever: Lever, readings: FloatArray, solver: Solver) -> FloatArray:
        """Force reading (N) of a cantilever with a wrong calibration, at depth readings (m).

        The bending that was not subtracted is proportional to the force reading, like a frame's compliance; it may
        be negative, and then the tip is deeper than the reading.
        """
        instrument = self.instrument
        offset = instrument.baseline + instrument.baseline_slope * readings
        chain = instrument.chain.with_compliance(instrument.compliance + lever.compliance)
        travel = readings - lever.compliance * offset
        deepest = float(chain.travel(travel).max(initial=0.0))
        reach = deepest if lever.compliance >= 0.0 else FURTHER * deepest
        law = ScaledLaw.of(self.contact_law(reach, solver=solver), 1.0, lever.gain, 1.0)
        w = chain.tip_depth(law, travel)
        if chain.frame is not None:
            chain.frame.require_standing(law.stiffness(w))
        return chain.reading(law.force(w), readings)

    def depth(
        self, force: ArrayLike, time: ArrayLike | None = None, *, solver: AnySolver = "auto"
    ) -> FloatArray:
        """Depth reading (m) for given force readings `force` (N), same shape: load control.

        `time` (s), (n,), are the times of the readings, which a scene with relaxation or drainage needs: its layer
        creeps.

        Raises
        ------
        InputError
            If a scene with relaxation or drainage has no suitable times, a force pulls, or the baseline is tilted.
        RangeError
            If no law reaches the largest force.
        """
        instrument = self.instrument
        if self.lever is not None:
            raise InputError("under given forces a lever's calibration is not simulated: leave the lever out")
        if instrument.baseline_slope:
            raise InputError(
                "under given forces a tilted baseline is not simulated: set instrument.baseline_slope to 0"
            )
        load = as_finite(force, "force") - instrument.baseline
        w = _pressed(self, load, time, as_solver(solver))
        return np.asarray(w + instrument.compliance * load + instrument.contact_depth)

    def response(self, law: ContactLaw) -> Response:
        """Force response of the sample in time, from its elastic law; the law itself for an elastic sample."""
        return law if self.memory is None else Remembered(law, self.memory)

    @property
    def ages(self) -> bool:
        """Whether the layer relaxes on an elastic base, so that their ratio of moduli changes in time."""
        if self.layer.relaxation is None or self.layer.material.drains:
            return False
        from underlay.mechanics.viscoelastic.elastic_base import ages  # noqa: PLC0415  see `memory`

        return ages(self.layer, self.substrate)

    def softened(self, share: float) -> Scene:
        """Return the elastic scene with every modulus of its layer multiplied by `share`."""
        elastic = self.elastic
        moduli = {
            path: share * number.value
            for path, number in elastic._numbers.items()  # noqa: SLF001  own class
            if path.startswith("layer.") and number.quantity.scales == "force"
        }
        return elastic.with_values(moduli)

    def _aged(self, law: ContactLaw, solver: Solver, depth: FloatArray, time: ArrayLike | None) -> Response:
        """Force response of a layer that relaxes on an elastic base, for depths since contact (m) at times (s).

        It is exact for a punch, whose contact radius is constant, else quasi-elastic. `law` is that of the contact
        without relaxation.

        Raises
        ------
        InputError
            If the error of the quasi-elastic force exceeds the solver's tolerance.
        """
        from underlay.mechanics.viscoelastic import elastic_base  # noqa: PLC0415  see `memory`
        from underlay.mechanics.viscoelastic.history import Viscoelastic  # noqa: PLC0415  see `memory`

        relaxation, clock = self.layer.relaxation, checked_times(time, depth)
        if relaxation is None:
            return law
        reach = law.max_depth if np.isfinite(law.max_depth) else max(float(depth.max()), 1e-9)
        if self.indenter.has_edge:
            solver = solver.with_tolerance(min(solver.tolerance, _FINE))
            modes = relaxation.modes(float(np.diff(clock).min()), float(clock[-1] - clock[0]))
            whole = modes.constant + float(modes.weights.sum())

            def stiffness(share: float) -> float:
                softened = self.softened(share * whole).contact_law(reach, solver=solver)
                return float(softened.stiffness(0.5 * reach))

            ratios = type(modes)(modes.constant / whole, modes.weights / whole, modes.times)
            punch = elastic_base.punch_relaxation(stiffness, ratios)
            return Remembered(self.softened(whole).contact_law(reach, solver=solver), Viscoelastic(punch))
        error = elastic_base.stated_error(relaxation, clock, depth)
        if solver.tolerance < error:
            raise InputError(
                "a layer that relaxes on an elastic base is simulated by the moduli of the moment, which here may "
                f"be up to {100.0 * error:.2g} % too low: ask for a tolerance (rtol) of {error:g} or more to "
                "accept that; a base 1000 times stiffer, a rigid one, none at all, or a flat punch is exact"
            )
        coarse = solver.with_tolerance(min(solver.tolerance, _SHARE * error))
        return elastic_base.QuasiElastic(
            lambda share: self.softened(share).contact_law(reach, solver=coarse), relaxation, reach
        )

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the scene by its path, e.g. ``{"layer.E": 1.2e6, ...}`` (SI)."""
        return {path: number.value for path, number in self._numbers.items()}

    @property
    def quantities(self) -> dict[str, Quantity]:
        """The `Quantity` (kind, name, bounds) of every number of the scene, by its path."""
        return {path: number.quantity for path, number in self._numbers.items()}

    @cached_property
    def _numbers(self) -> dict[str, Number]:
        """Numbers of the scene by path, collected once, since a fit needs them often."""
        return numbers_of(self)

    def with_values(self, values: Mapping[str, float]) -> Scene:
        """Return a scene with the numbers at the given paths replaced (SI).

        Raises
        ------
        ParameterError
            If the scene has no such path; names the nearest one.
        """
        if not values:
            return self
        for path in values:
            if path not in self._numbers:
                raise unknown_parameter(path, self._numbers)
        return replace_values(self, values, known=self._numbers)

    def effects(self, max_depth: float, *, solver: AnySolver = "auto") -> pd.DataFrame:
        """List each physical effect at tip depth `max_depth` (m): its size, whether it is simulated, its cost.

        See `underlay.scene.effects.effects_table` for the columns.
        """
        return effects_table(self, max_depth, solver)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the scene as a scene file that `load_scene` reads back bit for bit.

        Raises
        ------
        FileAccessError
            If the file cannot be written; an older file stays whole.
        """
        return write_atomic(path, scene_text(self))


def _pressed(scene: Scene, load: FloatArray, time: ArrayLike | None, solver: Solver) -> FloatArray:
    """Depth of the tip (m) under contact forces (N), with a law extended until it reaches the largest force."""
    if scene.ages:
        raise InputError(
            "a layer that relaxes on an elastic base is simulated under given depths only: use a rigid base"
        )
    top = float(load.max(initial=0.0))
    reach = _FIRST_DEPTH
    while True:
        law = _law_to(scene, reach, solver)
        try:
            if scene.memory is None:
                return law.depth(load)
            return Remembered(law, scene.memory).depth(load, time)
        except RangeError:
            if law.max_depth < reach or reach > _LAST_DEPTH:
                raise
        # The force at the end of the law gives the next depth: it grows at least in proportion to depth.
        reach *= max(2.0, min(top / float(law.force(law.max_depth)), _LEAP))


def _law_to(scene: Scene, reach: float, solver: Solver) -> ContactLaw:
    """Contact law up to a depth (m), or to the end of its range where that comes first."""
    try:
        return scene.contact_law(reach, solver=solver)
    except RangeError as error:
        if error.max_depth is None or error.max_depth >= reach:
            raise
        return scene.contact_law(error.max_depth, solver=solver)


def _check_drainage(scene: Scene) -> None:
    """Raise InputError for a poroelastic layer without a stated drainage, or with parts that are not simulated."""
    drains = scene.layer.material.drains
    for number, layer in enumerate(scene.layers[1:]):
        if layer.material.drains:
            raise InputError(f"substrate.layers[{number}] drains: only the layer on top may, on a rigid base")
    if not drains and scene.drainage is None:
        return
    if not drains:
        raise InputError(
            f"drainage = {scene.drainage!r:.40} is of a layer with a permeability; give it one, or leave it out"
        )
    if scene.drainage not in TIP_DRAINAGES:
        raise InputError(
            "a draining layer needs how water leaves at the tip: drainage must be one of "
            f"{', '.join(map(repr, TIP_DRAINAGES))}; got {scene.drainage!r:.40}"
        )
    from underlay.mechanics.biphasic.judgement import check_effects  # noqa: PLC0415  see `Scene.memory`

    check_effects(scene.layer, scene.substrate, scene.adhesion, scene.history, scene.discrepancy is not None)


def _check_sticking(scene: Scene) -> None:
    """Raise InputError for parts that are not simulated together with a tip without slip."""
    if scene.friction != "stuck":
        return
    if scene.adhesion is not None:
        raise InputError('adhesion beside friction = "stuck" is not simulated: leave one of them out')
    if scene.memory is not None:
        raise InputError(
            'friction = "stuck" beside a history or a relaxation is not simulated: how stuck points come loose '
            "in time is another problem; leave one of them out"
        )


def _check_on_law(scene: Scene) -> None:
    """Raise InputError where a layer's stiffening or sides are not known together with the scene's other parts."""
    if scene.layer.linear is scene.layer:
        return
    effects = {
        "friction": scene.friction == "stuck",
        "adhesion": scene.adhesion is not None,
        "history": scene.history is not None,
        "small strains": scene.finite_strain is False,
        "discrepancy": scene.discrepancy is not None,
    }
    laws_on(scene.indenter, scene.layer, scene.substrate, effects)


def _check_discrepancy(scene: Scene) -> None:
    """Raise InputError for parts that are not known together with a discrepancy of the law."""
    if scene.discrepancy is None:
        return
    if scene.friction != "unknown" or scene.finite_strain is False:
        said = f'friction = "{scene.friction}"' if scene.friction != "unknown" else "finite_strain = false"
        raise InputError(f"a discrepancy of the law beside {said}: leave one of them out")
    if not scene.is_elastic:
        raise InputError("a discrepancy of the law beside adhesion, a history or a relaxation is not known")


def _check_memory(scene: Scene) -> None:
    """Raise InputError for parts that are not simulated together with relaxation, drainage or a history."""
    if scene.memory is None:
        return
    if scene.history is not None and scene.layer.relaxation is not None:
        raise InputError("a scene remembers in one way: a relaxation of its layer or a history, not both")
    if scene.adhesion is not None:
        raise InputError(
            "adhesion beside a history or a relaxation is not simulated: how fast a sticking edge moves through a "
            "sample that remembers is another problem; leave one of them out"
        )
    if scene.lever is not None:
        raise InputError(
            "a lever's calibration beside a history or a relaxation is not simulated: leave the lever out; a "
            "spring constant that is off scales every modulus with it"
        )
    if scene.instrument.compliance:
        raise InputError(
            "a frame's compliance beside a history or a relaxation is not simulated: take it out of the "
            "depth first (depth - compliance * force) and set instrument.compliance to 0"
        )


def faces(scene: Scene) -> list[str]:
    """Names of the layers that stand on something, downwards: ``"layer"``, ``"substrate.layers[0]"``, ..."""
    if scene.base is None:
        return []
    return ["layer", *(f"substrate.layers[{number}]" for number in range(len(scene.layers) - 1))]


def has_face(scene: Scene, face: str = "layer") -> bool:
    """Whether the scene has a layer of that name with something under it."""
    return face in faces(scene)


def unknown_faces(scene: Scene) -> list[str]:
    """Names of the layers whose bond to what is under them is not known."""
    return [face for face in faces(scene) if _layer(scene, face).bond == "unknown"]


def bond_of(scene: Scene, face: str) -> Bond:
    """Bond of a face as it is computed: bonded where it is not known."""
    return _layer(scene, face).held.bond


def with_bond(scene: Scene, face: str, bond: Bond) -> Scene:
    """Return the scene with another bond of one face.

    Raises
    ------
    InputError
        If there is nothing under that layer.
    """
    layers, base = list(scene.layers), scene.base
    if base is None:
        raise InputError(f"nothing is under {face!r}")
    number = faces(scene).index(face)
    layers[number] = replace(layers[number], bond=bond)
    if number == 0:
        return replace(scene, layer=layers[0])
    return replace(scene, substrate=Stack(layers[1:], base))


def _layer(scene: Scene, face: str) -> Layer:
    return scene.layers[faces(scene).index(face)]
