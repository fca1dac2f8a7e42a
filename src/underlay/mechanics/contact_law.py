"""What every solver returns: a contact law; and the same law rescaled for a similar contact.

A `ContactLaw` turns indentation depth into force, contact radius and stiffness for one indenter on one body,
whichever solver made it. To add a law: derive a frozen dataclass, implement the three primitives (`_force`,
`_contact_radius`, `_stiffness`) for depths inside the law's `domain`, and leave the rest (scalars, Series, points
before contact, depths beyond the range) to this base class.

`ScaledLaw` is the law of a contact whose ratios of lengths and moduli are the same, obtained by scaling depth,
force and radius; fits in which these ratios are fixed use it. `DeeperThanLayer` is the warning about a tip pressed
deeper than the layer is thick, where linear elasticity does not hold.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import ArrayLike, FloatArray, as_finite
from underlay.errors import InputError, LawError, RangeError, UnderlayError
from underlay.mechanics.inverse import depth_at_loads
from underlay.mechanics.response import Response
from underlay.units import format_quantity

#: Why a law ends at the depth it was built for; completes the sentence of a RangeError.
CHOSEN_FOR_DEPTH = "the law was chosen for depths up to there; ask for less depth, or build it for more"
_LARGEST = float(np.finfo(float).max)
# A depth that was computed exceeds the largest by its rounding: so much is the same depth.
_ROUNDED = 1.0 + 4.0 * float(np.finfo(float).eps)
# Points of the equilibria of a law.
_DRAWN = 400


@dataclass(frozen=True)
class DeeperThanLayer:
    """Warning that a tip goes deeper than the layer is thick.

    Every law here is linear in the displacements. On a rigid base such a tip would stand inside the base; on a
    soft one a film may bend that far, and its stretch is not in the law. The results are those of the linear
    problem, given with this warning rather than refused.

    Parameters
    ----------
    depth : float
        Of the tip since contact (m).
    thickness : float
        Of the layer (m).
    """

    depth: float
    thickness: float

    @classmethod
    def of(cls, depth: float, thickness: float) -> DeeperThanLayer | None:
        """The warning for a `depth` (m); None where that is at most the `thickness` (m)."""
        return cls(depth, thickness) if depth > thickness else None

    def __str__(self) -> str:
        return (
            f"the tip goes {format_quantity(self.depth, 'length')} deep into a layer "
            f"{format_quantity(self.thickness, 'length')} thick, where linear elasticity says nothing true: use "
            "less of the curve ([curve] max_depth), or check depth, thickness and their units"
        )


class ContactState(NamedTuple):
    """One state of a contact: depth of the tip (m), force (N) and contact radius (m)."""

    depth: float
    force: float
    radius: float


@dataclass(frozen=True, kw_only=True)
class ContactLaw(Response, ABC):
    """Force against depth for one indenter and body, independent of time.

    Depth is the indentation depth w (m) from first contact, positive into the sample; force is positive in
    compression (N). Up to the smallest depth of its `domain`, zero unless a law says otherwise, there is no
    contact: force, radius and stiffness are zero.

    Parameters
    ----------
    method : str
        Name of the solver, e.g. ``"halfspace"``, ``"asymptotic"``, ``"exact"``.
    reason : str
        Why this solver was chosen, in words.
    max_depth : float
        Largest depth (m) at which the law can be evaluated.
    error_estimate : float
        Estimated relative error of the force against the exact contact problem, for depths up to
        `max_depth`.
    warnings : tuple, default ()
        Warnings about this contact, whose ``str`` are sentences.
    """

    method: str
    reason: str
    max_depth: float
    error_estimate: float
    warnings: tuple[object, ...] = ()

    @classmethod
    def over(cls, law: ContactLaw, /, **own: Any) -> Self:
        """Law made from another one: what `own` does not give of the fields above is as that one has it."""
        names = ("method", "reason", "max_depth", "error_estimate", "warnings")
        return cls(**{name: getattr(law, name) for name in names} | own)

    def force(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Force P (N), shape of `depth` (m); `time` is ignored, since the sample is elastic.

        Raises
        ------
        RangeError
            If a depth is beyond `max_depth`.
        InputError
            If a depth is not finite.
        LawError
            If the law itself fails, or returns NaN or another shape.
        """
        del time
        return self._in_contact(depth, self._force)

    def contact_radius(self, depth: ArrayLike) -> FloatArray:
        """Contact radius a (m), shape of `depth` (m); raises as `force` does."""
        return self._in_contact(depth, self._contact_radius)

    def stiffness(self, depth: ArrayLike, time: ArrayLike | None = None) -> FloatArray:
        """Incremental stiffness dP/dw (N/m) (9.1), shape of `depth` (m); raises as `force` does.

        Equation numbers are those of Argatov and Sabina.
        """
        del time
        return self._in_contact(depth, self._stiffness)

    def force_and_stiffness(self, depth: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Force P (N) and dP/dw (N/m), each of the shape of `depth` (m), cheaper than the two separately.

        Raises as `force` does.
        """
        both = self._in_contact(depth, self._force_and_stiffness, 2)
        return both[0], both[1]

    def depth(self, force: ArrayLike) -> FloatArray:
        """Indentation depth (m) at `force` (N): the inverse of `force`, which must increase with depth.

        Raises
        ------
        InputError
            If a force is below that at the beginning of the law's domain (zero for most), or not finite.
        RangeError
            If a force is beyond that at `max_depth`.
        """
        load = as_finite(force, "force")
        start, least = self.domain[0], self._least_force
        if (load < least).any():
            raise InputError(f"a depth is known for forces of {least:.6g} N or more; got {load.min():.6g} N")
        flat = np.atleast_1d(load).ravel()
        depth = np.full_like(flat, start)
        loaded = flat > least
        if loaded.any():
            depth[loaded] = depth_at_loads(
                self._force, self._stiffness, flat[loaded], least, self.domain, self._beyond
            )
        return depth.reshape(load.shape)[()]

    @property
    def domain(self) -> tuple[float, float]:
        """Smallest and largest depth (m) of the law; up to the smallest there is no contact."""
        return 0.0, self.max_depth

    @property
    def beginning(self) -> tuple[float, float]:
        """Depth (m) and force (N) at which contact begins or is lost, as in `Response.beginning`."""
        return self.domain[0], self._least_force

    @property
    def linear_law(self) -> ContactLaw:
        """The linear elastic law without modifications (stiffening, free sides); itself where there are none."""
        return self

    # --- where the contact is lost: an elastic law has no tension, and says zero --------------------------------

    @property
    def pull_off_force(self) -> float:
        """Largest tension (N, positive) that the contact bears under load control; zero without adhesion."""
        return -self._least_force

    @property
    def pull_off_depth(self) -> float:
        """Depth (m) at which the contact is lost under depth control; mostly negative with adhesion."""
        return self.domain[0]

    @property
    def zero_load_radius(self) -> float:
        """Contact radius (m) in equilibrium without load."""
        return float(self.contact_radius(self.depth(0.0))) if self._least_force else 0.0

    def pull_off(self, compliance: float = 0.0) -> ContactState:
        """State in which the tip comes off, behind a spring of `compliance` (m/N).

        Zero is a given depth (depth control), inf a given load.
        """
        del compliance
        start = self.domain[0]
        edge = np.array([start])
        return ContactState(start, self._least_force, float(self._contact_radius(edge)[0]) if start else 0.0)

    def jump_in(self, compliance: float = 0.0) -> ContactState:
        """State right after first contact, behind a spring of `compliance` (m/N); zero without adhesion."""
        del compliance
        return ContactState(0.0, 0.0, 0.0)

    def jump_travels(self, compliance: float = 0.0) -> tuple[float, ...]:
        """Travels (m) at which the force jumps, behind a spring of `compliance` (m/N); none without adhesion.

        The travel is the depth plus the spring's deflection.
        """
        first, least = self.beginning
        return (first + compliance * least,) if least else ()

    def equilibria(self, max_depth: float) -> tuple[FloatArray, FloatArray]:
        """Depths (m) and forces (N), each (n,), of all equilibria up to `max_depth` (m), unstable ones included."""
        depth = np.linspace(self.domain[0], max_depth, _DRAWN)
        return depth, self.force(depth)

    def warned(self, doubt: object) -> Self:
        """Copy of the law with `doubt`, whose ``str`` is a sentence, added to its `warnings`."""
        law = copy(self)
        # Not `replace`: a law of one's own may be made in another way than from its fields.
        object.__setattr__(law, "warnings", (*self.warnings, doubt))
        return law

    @property
    def known_slopes(self) -> int:
        """Number of parameters in which the law gives the derivative of its force: see `with_slopes`."""
        return 0

    def with_slopes(self, depth: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Force P (N) and dP/dw (N/m), each (n,), and dP/ds (N), (known_slopes, n), at depths (m), (n,).

        s are the parameters of `Contact.variants`; for laws read off tables, the log of a ratio of moduli, and
        for tips that are no power law then that of the thickness. Raises as `force` does.
        """
        rows = self._in_contact(depth, self._with_slopes, 2 + self.known_slopes)
        return rows[0], rows[1], rows[2:]

    def work_slope(self, depth: FloatArray) -> FloatArray | None:
        """dP/d ln(work of adhesion) (N) at fixed depths (m), (n,); None where the law does not provide it."""
        del depth
        return None

    @abstractmethod
    def _force(self, depth: FloatArray) -> FloatArray:
        """Force (N) at depths (m) inside the domain, 1-D."""

    @abstractmethod
    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        """Contact radius (m) at depths (m) inside the domain, 1-D."""

    @abstractmethod
    def _stiffness(self, depth: FloatArray) -> FloatArray:
        """dP/dw (N/m) at depths (m) inside the domain, 1-D."""

    def _force_and_stiffness(self, depth: FloatArray) -> FloatArray:
        """Force (N) and dP/dw (N/m) at depths (m) inside the domain, (n,), as rows (2, n)."""
        return np.stack((self._force(depth), self._stiffness(depth)))

    def _with_slopes(self, depth: FloatArray) -> FloatArray:
        """Rows of force (N), dP/dw (N/m) and the `known_slopes` derivatives dP/ds (N): (2 + known_slopes, n)."""
        return self._force_and_stiffness(depth)

    @property
    def nodes(self) -> int | None:
        """Number of radial nodes of the numerical solution; None for closed formulas."""
        return None

    @property
    @abstractmethod
    def _beyond(self) -> str:
        """Why the law ends at `max_depth`, and what to do: the last clause of a RangeError's message."""

    def _in_contact(
        self, depth: ArrayLike, primitive: Callable[[FloatArray], FloatArray], *rows: int
    ) -> FloatArray:
        """Evaluate `primitive` at the depths in contact and put zeros elsewhere, after checking the range.

        `primitive` maps depths (n,) to values (*rows, n); the result has the shape (*rows, *depth.shape).
        """
        w = np.asarray(depth, dtype=np.float64)
        flat = w.reshape(-1)
        # NaN fails the comparison too, and so does inf where the law has no end: as_finite names them.
        if flat.size and not flat[flat.argmax()] <= min(self.max_depth * _ROUNDED, _LARGEST):
            as_finite(w, "depth")
            raise RangeError(
                f"depth {flat.max():.6g} m is beyond the largest that works here, "
                f"{self.max_depth:.6g} m: {self._beyond}",
                max_depth=self.max_depth,
            )
        touching = self._touching(w if w.ndim > 1 else flat).reshape(-1)
        count = np.count_nonzero(touching)
        if count == flat.size:
            return self._answer(primitive, flat, rows).reshape((*rows, *w.shape))[()]
        # Depths mostly come in order, those in contact last: a slice of them spares a gather and a scatter.
        first = flat.size - count
        ordered = touching.argmax() == first
        before = flat[:first] if ordered else flat[~touching]
        if not math.isfinite(before[before.argmin()]):
            as_finite(w, "depth")
        values = np.zeros((*rows, flat.size))
        if count:
            where = slice(first, None) if ordered else touching
            values[..., where] = self._answer(primitive, flat[where], rows)
        return values.reshape((*rows, *w.shape))[()]

    def _touching(self, depth: FloatArray) -> NDArray[np.bool_]:
        """Mask of the depths (..., n), given in the order in which they are reached, that are in contact."""
        return depth > self.domain[0]

    def _answer(
        self, primitive: Callable[[FloatArray], FloatArray], depth: FloatArray, rows: tuple[int, ...]
    ) -> FloatArray:
        """Values (*rows, n) of `primitive` at depths (n,); LawError if it fails or returns NaN or another shape."""
        try:
            values = primitive(depth)
        except UnderlayError:
            raise
        except Exception as error:
            raise self._broken(primitive, f"{type(error).__name__}: {error}", depth) from error
        if np.shape(values) != (*rows, depth.size):
            shapes = f"shape {np.shape(values)} to depths of shape {depth.shape}"
            raise self._broken(primitive, f"answered with {shapes}", depth)
        # What is largest where there is NaN is NaN, and its place takes a quarter of the time that its value does.
        if values.size and math.isnan(values.flat[values.argmax()]):
            first = depth[np.isnan(values).reshape(-1, depth.size).any(axis=0)][:1]
            raise self._broken(primitive, "answered with NaN", first)
        return values

    def _broken(
        self, primitive: Callable[[FloatArray], FloatArray], what: str, depth: FloatArray
    ) -> LawError:
        """LawError saying that `primitive` did `what`, with the first depth that alone causes it."""
        name = getattr(primitive, "__name__", "").removeprefix("_") or "answer"
        at = depth
        for one in depth[:, None] if len(depth) > 1 else ():
            try:
                found = np.asarray(primitive(one))
            except Exception:  # noqa: BLE001  any failure of a law that is not ours is what is looked for
                at = one
                break
            if found.shape[-1:] != (1,):
                at = one
                break
        where = (
            f"{at[0]:.6g} m" if len(at) == 1 else f"{len(at)} depths from {at.min():.6g} to {at.max():.6g} m"
        )
        return LawError(f"the law {self.method} ({type(self).__name__}.{name}) at depth {where}: {what}")

    @property
    def _least_force(self) -> float:
        """Force (N) at the smallest depth of the domain."""
        start = self.domain[0]
        return float(self._force(np.array([start]))[0]) if start else 0.0


class OnLaw(ABC):
    """Modification of the linear elastic law of a contact, such as stiffening or free sides."""

    @abstractmethod
    def law(self, inner: Callable[[float], ContactLaw], max_depth: float) -> ContactLaw:
        """Modified law up to `max_depth` (m); `inner` builds the law to be modified, up to a given depth (m)."""


@dataclass(frozen=True, kw_only=True)
class LawOnLaw(ContactLaw):
    """Law that stands on another one, `inner`, and has its nodes, its range and its reason to end."""

    inner: ContactLaw

    @property
    def domain(self) -> tuple[float, float]:
        """Smallest and largest depth (m): from that of the inner law to `max_depth`."""
        return self.inner.domain[0], self.max_depth

    @property
    def nodes(self) -> int | None:
        """Number of radial nodes of the inner law's solution; None for closed formulas."""
        return self.inner.nodes

    @property
    def _beyond(self) -> str:
        return self.inner._beyond  # noqa: SLF001  the law behind this one


@dataclass(frozen=True, kw_only=True)
class ScaledLaw(LawOnLaw):
    """Law of a similar contact, from a reference law: P(w) = c P_ref(b w), a(w) = s a_ref(b w).

    Contacts are similar if their ratios of lengths and of moduli are the same.

    Parameters
    ----------
    inner : ContactLaw
        The reference.
    b, c, s : float
        Factors of depth, force and contact radius.
    """

    b: float
    c: float
    s: float

    @classmethod
    def of(cls, law: ContactLaw, b: float, c: float, s: float) -> Self:
        """Law P(w) = c P_ref(b w), a(w) = s a_ref(b w) of the reference `law`; `b`, `c` and `s` positive."""
        # Written out: a fit makes one at every step.
        return cls(
            method=law.method,
            reason=law.reason,
            max_depth=law.max_depth / b,
            error_estimate=law.error_estimate,
            warnings=law.warnings,
            inner=law,
            b=b,
            c=c,
            s=s,
        )

    @property
    def domain(self) -> tuple[float, float]:
        """Smallest and largest depth (m) of this contact."""
        return self.inner.domain[0] / self.b, self.max_depth

    @property
    def known_slopes(self) -> int:
        """Number of derivatives that the reference law gives."""
        return self.inner.known_slopes

    def work_slope(self, depth: FloatArray) -> FloatArray | None:
        """dP/d ln(work of adhesion) (N) at fixed depths (m), (n,): c times the reference's, or None."""
        slope = self.inner.work_slope(self.b * depth)
        return None if slope is None else self.c * slope

    @property
    def pull_off_force(self) -> float:
        """Largest tension (N, positive) under load control: c times the reference's."""
        return self.c * self.inner.pull_off_force

    @property
    def zero_load_radius(self) -> float:
        """Contact radius (m) in equilibrium without load: s times the reference's."""
        return self.s * self.inner.zero_load_radius

    def pull_off(self, compliance: float = 0.0) -> ContactState:
        """State in which the tip comes off, behind a spring of `compliance` (m/N), scaled from the reference's."""
        return self._here(self.inner.pull_off(self.b * self.c * compliance))

    def jump_in(self, compliance: float = 0.0) -> ContactState:
        """State right after first contact, behind a spring of `compliance` (m/N), scaled from the reference's."""
        return self._here(self.inner.jump_in(self.b * self.c * compliance))

    def jump_travels(self, compliance: float = 0.0) -> tuple[float, ...]:
        """Travels (m) at which the force jumps, behind a spring of `compliance` (m/N): the reference's over b."""
        return tuple(travel / self.b for travel in self.inner.jump_travels(self.b * self.c * compliance))

    def equilibria(self, max_depth: float) -> tuple[FloatArray, FloatArray]:
        """Depths (m) and forces (N), each (n,), of all equilibria up to `max_depth` (m), from the reference's."""
        depth, force = self.inner.equilibria(self.b * max_depth)
        return depth / self.b, self.c * force

    def _here(self, there: ContactState) -> ContactState:
        return ContactState(there.depth / self.b, self.c * there.force, self.s * there.radius)

    def depth(self, force: ArrayLike) -> FloatArray:
        """Indentation depth (m), shape of `force` (N), from the inverse of the reference law."""
        return np.asarray(self.inner.depth(np.asarray(force, dtype=np.float64) / self.c) / self.b)

    def tip_depth(self, travel: FloatArray, compliance: float) -> FloatArray | None:
        """Depth w (m), (n,), with w + `compliance` P(w) = `travel` (m), from the reference law; None if unknown.

        `compliance` is that of the spring (m/N).
        """
        w = self.inner.tip_depth(self.b * travel, self.b * self.c * compliance)
        return None if w is None else w / self.b

    def _touching(self, depth: FloatArray) -> NDArray[np.bool_]:
        return self.inner._touching(self.b * depth)  # noqa: SLF001  the law this one is a picture of

    @property
    def _least_force(self) -> float:
        return self.c * self.inner._least_force  # noqa: SLF001  the law this one is a picture of

    def _force(self, depth: FloatArray) -> FloatArray:
        return self.c * self.inner._force(self.b * depth)  # noqa: SLF001  as above

    def _contact_radius(self, depth: FloatArray) -> FloatArray:
        return self.s * self.inner._contact_radius(self.b * depth)  # noqa: SLF001  as above

    def _stiffness(self, depth: FloatArray) -> FloatArray:
        return (self.b * self.c) * self.inner._stiffness(self.b * depth)  # noqa: SLF001  as above

    def _force_and_stiffness(self, depth: FloatArray) -> FloatArray:
        both = self.inner._force_and_stiffness(self.b * depth)  # noqa: SLF001  as above
        both[0] *= self.c
        both[1] *= self.b * self.c
        return both

    def _with_slopes(self, depth: FloatArray) -> FloatArray:
        rows = self.inner._with_slopes(self.b * depth)  # noqa: SLF001  as above
        rows *= self.c
        rows[1] *= self.b
        return rows
