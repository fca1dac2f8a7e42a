"""Models of curves and their derivatives, as searches ask for them: at one vector, kept; at several, together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.jacobian_batch import batched_jacobians, goes_together
from underlay.inference.model.members import Member

__all__ = ["Models"]


class Models:
    """What the curves' models say at vectors in SI, (k,) or (s, k); `count` counts them.

    MINPACK asks for its first point twice and lmfit for its last; the noise may change in between. So the last
    answers are kept, without weights. And nearly every point whose force is asked is then asked for its
    derivatives, which bring the force along: where they cost no law they are computed at once.

    Parameters
    ----------
    members : sequence of Member
        The curves.
    """

    def __init__(self, members: Sequence[Member]) -> None:
        self.members, self.count = members, 0
        self._last_models: tuple[bytes, list[FloatArray]] = (b"", [])
        self._last_columns: dict[bool, tuple[bytes, list[FloatArray]]] = {}
        self._followed = b"", b""
        # Where no free parameter moves a ratio, or tables give the derivative in it, no further law is needed.
        self._one_law = not any(
            member.forward.similarity.ratio_slopes(path, member.base)
            for member in members
            if not member.forward.laws.know_slopes
            for path in member.entries
        )

    @property
    def laws_in_batches(self) -> bool:
        """Whether laws of several vectors at once are less work than one by one."""
        return any(member.forward.laws.tips is not None for member in self.members)

    @cached_property
    def in_batches(self) -> bool:
        """Whether derivatives at several vectors at once are less work than one by one."""
        return self._one_law and all(
            not member.forward.laws.is_solved
            and goes_together(member.forward, member.base, tuple(member.entries))
            for member in self.members
        )

    def models(self, physical: FloatArray) -> list[FloatArray]:
        """Instrument's force (N), (n,), of every curve; raises InputError where no law exists."""
        key = physical.tobytes()
        if self._last_models[0] != key:
            if self._one_law:
                self.columns(physical, rough=True)
            else:
                self.count += 1
                self._last_models = key, [member.model(physical) for member in self.members]
        return self._last_models[1]

    def columns(self, physical: FloatArray, *, rough: bool) -> list[FloatArray]:
        """d force / d own entry (SI), (n, own), of every curve; `rough` as in `Forward.jacobian`."""
        key = physical.tobytes()
        for is_rough in (False, True) if rough else (False,):
            last, columns = self._last_columns.get(is_rough, (b"", []))
            if last == key:
                return columns
        both = [
            member.forward.jacobian(member.values_at(physical), tuple(member.entries), rough=rough)
            for member in self.members
        ]
        columns = [own for _, own in both]
        # Off tables a derivative is a difference of laws: rough ones serve those alone who ask for no others.
        self._last_columns[any(reading.is_rough for reading, _ in both)] = key, columns
        if self._last_models[0] != key:
            self.count += 1
            self._last_models = key, [reading.force for reading, _ in both]
        return columns

    def follow(self, physical: FloatArray, near: Callable[[FloatArray, list[FloatArray]], bool]) -> bool:
        """Whether the models at a vector (k,) follow by their slopes from those asked last, and are kept so.

        `near` is told the step (k,) and the derivatives, (n, own) each, in SI: whether it is little.
        """
        key, columns = self._last_columns.get(False, (b"", []))
        if not key or key in (self._followed[0], physical.tobytes()) or key != self._last_models[0]:
            return False
        step = physical - np.frombuffer(key)
        if not near(step, columns):
            return False
        changes = [
            own @ step[list(member.entries.values())]
            for own, member in zip(columns, self.members, strict=True)
        ]
        there = physical.tobytes()
        models = [model + change for model, change in zip(self._last_models[1], changes, strict=True)]
        self._last_models, self._last_columns[False] = (there, models), (there, columns)
        self._followed = there, key
        return True

    def asked_for(self, physical: FloatArray) -> FloatArray:
        """Vector (k,) of the laws behind the models at a vector (k,): that itself, or the one they `follow`."""
        there, key = self._followed
        return np.frombuffer(key) if physical.tobytes() == there else physical

    def several(
        self, physical: FloatArray, possible: NDArray[np.bool_]
    ) -> tuple[list[FloatArray], list[FloatArray]]:
        """d force / d own entry, (s, own, n), and forces, (s, n), of every curve at vectors (s, k).

        Rows without a law are taken out of `possible` (s,), and zero.
        """
        if len(physical) == 1:
            return self._one(physical, possible)
        together = self._together(physical) if self.in_batches else None
        if together is not None:
            columns, models, known = together
            missing = possible & ~known
            self.count += int(np.count_nonzero(possible & known))
        else:
            columns, models = self._room(len(physical))
            missing = possible.copy()
            self._prepare(physical[possible])
        for row in np.flatnonzero(missing).tolist():
            own, forces = self._one(physical[row : row + 1], possible[row : row + 1])
            for into, each in zip((*columns, *models), (*own, *forces), strict=True):
                into[row] = each[0]
        return columns, models

    def _room(self, sets: int) -> tuple[list[FloatArray], list[FloatArray]]:
        """Zeros for the derivatives and the forces of every curve."""
        points = [len(member.force) for member in self.members]
        columns = [
            np.zeros((sets, len(member.entries), n)) for member, n in zip(self.members, points, strict=True)
        ]
        return columns, [np.zeros((sets, n)) for n in points]

    def _one(
        self, physical: FloatArray, possible: NDArray[np.bool_]
    ) -> tuple[list[FloatArray], list[FloatArray]]:
        """What `several` says of one row, (1, k)."""
        if possible[0]:
            try:
                own = self.columns(physical[0], rough=True)
                return [part.T[None] for part in own], [part[None] for part in self.models(physical[0])]
            except InputError:
                possible[0] = False
        return self._room(1)

    def _together(
        self, physical: FloatArray
    ) -> tuple[list[FloatArray], list[FloatArray], NDArray[np.bool_]] | None:
        """All rows at once, and which of them (s,) have their answers; None where none has."""
        found = [
            batched_jacobians(
                member.forward, member.values_of(physical), len(physical), tuple(member.entries)
            )
            for member in self.members
        ]
        known = [each for each in found if each is not None]
        if len(known) < len(found):
            return None
        possible = known[0].possible
        for each in known[1:]:
            possible = possible & each.possible
        return [each.columns for each in known], [each.force for each in known], possible

    def _prepare(self, physical: FloatArray) -> None:
        """Make ready what the models at vectors (s, k) need, where that is less work all at once."""
        if self.laws_in_batches and len(physical) > 1:
            for member in self.members:
                member.forward.prepare([member.values_at(one) for one in physical])
