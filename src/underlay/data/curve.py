"""A measured or synthetic curve: depth, force, time and segments in SI, read-only, with their origin.

A `Curve` is immutable: methods that select points or add metadata return a new one, so that arrays can be shared
between the steps of an analysis. `Metadata` holds what is known of its file and of how it was processed, as plain
values that can be written to JSON and sent to other processes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeGuard, final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from underlay._arrays import SMALLEST_LENGTH, ArrayLike, FloatArray
from underlay._text import one_line
from underlay.data.equilibrium import equilibrium_points
from underlay.data.segments import HOLD, LOADING, UNLOADING, one_label, one_of_each, segments_from_motion
from underlay.errors import CurveError, InputError

#: Fewer points than this are not fitted.
MIN_POINTS = 8
_LABELS = (LOADING, HOLD, UNLOADING)
#: How a copy of a curve says it in a comment.
RECORDED = "recorded: "
# Entries of a file's header, in the order they are told; what a file calls them, in lower case.
_ENTRIES = (("device", "instrument"), ("software version",), ("date",), ("time",))


@final
class Metadata(Mapping[str, Any]):
    """A read-only mapping of names to plain values.

    Values are text, numbers, booleans, None, tuples of these and further `Metadata`; lists become tuples
    and mappings become `Metadata`. It can be pickled (curves travel to worker processes) and written as
    JSON through `to_dict`.

    Parameters
    ----------
    values : mapping, optional
        What to hold.

    Raises
    ------
    InputError
        If a value is not plain.

    Examples
    --------
    >>> Metadata({"reader": "csv"}).updated(test=2)
    Metadata({'reader': 'csv', 'test': 2})
    """

    __slots__ = ("_values",)

    def __init__(self, values: Mapping[str, Any] | None = None) -> None:
        self._values = {str(key): _plain(str(key), value) for key, value in (values or {}).items()}

    def __getitem__(self, key: str) -> Any:
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return f"Metadata({self.to_dict()!r})"

    def updated(self, /, **values: Any) -> Metadata:
        """Return a copy with some entries added or replaced."""
        added = Metadata(values)
        added._values = {**self._values, **added._values}  # what is held here is plain already
        return added

    def to_dict(self) -> dict[str, Any]:
        """Return nested plain dictionaries and lists, ready for JSON."""
        return {key: _thaw(value) for key, value in self._values.items()}


# `isinstance` takes a tuple of types twice as fast as their union, and every value of every curve comes here.
_AS_THEY_ARE = (str, bool, int, float, Metadata)


def _plain(key: str, value: Any) -> Any:
    if value is None or isinstance(value, _AS_THEY_ARE):
        return value
    if isinstance(value, np.generic):
        return _plain(key, value.item())
    if isinstance(value, Mapping):
        return Metadata(value)
    if isinstance(value, np.ndarray):
        return _plain(key, value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, bytes | bytearray):
        return tuple(_plain(key, item) for item in value)
    raise InputError(
        f"metadata {key!r} must be text, a number or a tuple or mapping of these; got {value!r:.80}"
    )


def _thaw(value: Any) -> Any:
    if isinstance(value, Metadata):
        return value.to_dict()
    if isinstance(value, tuple):
        return [_thaw(item) for item in value]
    return value


@dataclass(frozen=True, eq=False)
class Curve:
    """One indentation curve.

    Parameters
    ----------
    depth : array_like (n,)
        Depth reading (m), growing into the sample. Its zero is arbitrary; the contact point is found or fitted.
    force : array_like (n,)
        Force (N), positive in compression.
    time : array_like (n,), optional
        Time (s).
    segment : array_like (n,) of str, optional
        ``"loading"``, ``"hold"`` or ``"unloading"`` for each point. Without it `segments` finds them from the
        motion.
    metadata : mapping, optional
        What is known of the curve: name, file, hash, reader, sign conventions, units of the file, ...
    truth : mapping, optional
        For a synthetic curve, the true parameters it was made from.
    columns : mapping of str to array_like (n,), optional
        Further columns of a file (SI), NaN where it has no value. For an averaged curve: ``depth_scatter``,
        ``force_scatter`` (standard deviations over the tests, the noise), and ``contact_stiffness`` (N/m) with
        ``contact_stiffness_scatter``, as far as they were measured.

    Raises
    ------
    CurveError
        If lengths differ, a column does not hold numbers, or a segment has another name. NaN is allowed here, so
        that a faulty file can be inspected; `check_fittable` refuses it.

    Examples
    --------
    >>> curve = Curve([0.0, 1e-6, 2e-6], [0.0, 1e-9, 3e-9])
    >>> len(curve), curve.depth.flags.writeable
    (3, False)
    """

    depth: FloatArray
    force: FloatArray
    time: FloatArray | None = None
    segment: NDArray[np.str_] | None = None
    metadata: Mapping[str, Any] = field(default_factory=Metadata)
    truth: Mapping[str, Any] | None = None
    columns: Mapping[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        depth = _column(self.depth, "depth")
        _set(self, "depth", depth)
        _set(self, "force", _column(self.force, "force", len(depth)))
        if self.time is not None:
            _set(self, "time", _column(self.time, "time", len(depth)))
        if self.segment is not None:
            _set(self, "segment", _labels(self.segment, len(depth)))
        if not isinstance(self.metadata, Metadata):
            _set(self, "metadata", Metadata(self.metadata))
        if self.truth is not None:
            _set(self, "truth", Metadata(self.truth))
        columns = {name: _column(values, name, len(depth)) for name, values in self.columns.items()}
        # A plain dict travels to worker processes, a mapping proxy does not.
        _set(self, "columns", columns)

    def __len__(self) -> int:
        return len(self.depth)

    def __repr__(self) -> str:
        name = self.metadata.get("name")
        return f"<Curve{f' {name!r}' if name else ''}, {len(self)} points>"

    @classmethod
    def from_frame(cls, frame: pd.DataFrame) -> Curve:
        """Make a curve from a table with columns depth (m), force (N) and, optionally, time (s) and segment.

        Raises
        ------
        CurveError
            If depth or force is missing; names the columns that are there.
        """
        for name in ("depth", "force"):
            if name not in frame.columns:
                there = ", ".join(repr(str(column)) for column in frame.columns)
                raise CurveError(f"the table has no column {name!r}; it has {there or 'none'}")
        metadata = frame.attrs.get("metadata", {})
        return cls(
            frame["depth"].to_numpy(),
            frame["force"].to_numpy(),
            time=frame["time"].to_numpy() if "time" in frame.columns else None,
            segment=frame["segment"].to_numpy() if "segment" in frame.columns else None,
            metadata=metadata if isinstance(metadata, Mapping) else {},
        )

    def to_frame(self) -> pd.DataFrame:
        """Return a table with columns depth (m), force (N) and, as far as known, time (s), segment and others."""
        columns: dict[str, Any] = {"depth": self.depth.copy(), "force": self.force.copy()}
        if self.time is not None:
            columns["time"] = self.time.copy()
        if self.segment is not None:
            columns["segment"] = self.segment.copy()
        columns |= {name: values.copy() for name, values in self.columns.items()}
        frame = pd.DataFrame(columns)
        frame.attrs["metadata"] = dict(self.metadata)
        return frame

    def select(self, which: slice | ArrayLike) -> Curve:
        """Return a curve of some of the points.

        Parameters
        ----------
        which : slice, or array_like of bool (n,) or of int
            The points to keep.
        """
        index = which if isinstance(which, slice) else np.asarray(which)
        if isinstance(index, np.ndarray) and index.size == 0:
            index = index.astype(np.intp)
        try:
            depth = _picked(self.depth, index)
        except IndexError as error:
            raise CurveError(f"cannot select from a curve of {len(self)} points: {error}") from error
        return self._of(index, depth, None if self.segment is None else self.segment[index])

    def with_metadata(self, /, **values: Any) -> Curve:
        """Return the curve with some metadata added or replaced."""
        # Nothing but the metadata is looked at again: a curve passes here several times on its way from a file.
        return self._noted("metadata", self._about.updated(**values))

    def with_truth(self, truth: Mapping[str, Any]) -> Curve:
        """Return the curve with the true parameters it was made from, by path."""
        return replace(self, truth=truth)

    def segments(self) -> NDArray[np.str_]:
        """Return the label of every point, (n,): from the file, else from the motion of the depth."""
        return self._by_motion if self.segment is None else self.segment

    @property
    def _about(self) -> Metadata:
        """The metadata, as the `Metadata` into which they are converted when the curve is made."""
        return self.metadata if isinstance(self.metadata, Metadata) else Metadata(self.metadata)

    @cached_property
    def _by_motion(self) -> NDArray[np.str_]:
        labels = segments_from_motion(self.depth, self.time, self.force)
        labels.flags.writeable = False
        return labels

    def loading(self) -> Curve:
        """Return the points where the indenter moves into the sample."""
        return self._part(LOADING)

    def hold(self) -> Curve:
        """Return the points where the indenter is held."""
        return self._part(HOLD)

    def unloading(self) -> Curve:
        """Return the points where the indenter is withdrawn."""
        return self._part(UNLOADING)

    def way_in(self) -> Curve:
        """Return the loading points; of a curve that is all unloading, its points in reverse order.

        An elastic sample gives the same force on unloading as on loading, so what looks for the contact or judges a
        loading curve can read an unloading one backwards.
        """
        labels = self.segments()
        if len(self) and (labels == UNLOADING).all():
            return self.unloading().select(slice(None, None, -1))
        return self.loading()

    def equilibrium(self, share: float = 0.1) -> Curve:
        """Return the equilibrium points of a stepwise relaxation test as a curve, one point per hold.

        Each point is the mean over the last part of a hold; see `equilibrium_points`. The metadata hold
        ``force_standard_error`` (N), ``drift`` (N over that part) and ``stationary``, one value per point, and a
        note where a hold was still relaxing.

        Parameters
        ----------
        share : float
            Last part of each hold that is averaged, as a fraction of its duration.

        Raises
        ------
        CurveError
            If the curve has no hold after loading.
        """
        points = equilibrium_points(self.depth, self.force, self.time, self.segments(), share=share)
        restless = [number for number, still in enumerate(points.stationary, start=1) if not still]
        metadata = self._about.updated(
            equilibrium_share=share,
            force_standard_error=points.force_standard_error,
            drift=points.drift,
            stationary=points.stationary,
            notes=(
                *self.metadata.get("notes", ()),
                *(f"hold {number} was still relaxing at its end" for number in restless),
            ),
        )
        return Curve(points.depth, points.force, points.time, None, metadata, self.truth)

    def _part(self, label: str) -> Curve:
        labels = self.segments()
        here = one_of_each(labels) == label
        if here.all():
            return self if self.segment is not None else self._noted("segment", one_label(label, len(self)))
        here = np.broadcast_to(here, labels.shape)
        return self._of(here, _picked(self.depth, here), one_label(label, int(np.count_nonzero(here))))

    def _noted(self, name: str, value: Any) -> Curve:
        """Return the same points with another value of one field, such as the metadata, without checking it."""
        noted = object.__new__(type(self))
        noted.__dict__.update(self.__dict__, **{name: value})
        return noted

    def _of(self, index: Any, depth: FloatArray, segment: NDArray[np.str_] | None) -> Curve:
        """Return the curve of the points at `index`, given their depth (m) and segment labels."""
        return replace(
            self,
            depth=depth,
            force=_picked(self.force, index),
            time=None if self.time is None else _picked(self.time, index),
            segment=segment,
            columns={name: _picked(values, index) for name, values in self.columns.items()},
        )


def check_fittable(curve: Curve, contact_depth: float | None = None, *, withdrawn: bool = False) -> None:
    """Raise an error for a curve that no contact law can be fitted to.

    Parameters
    ----------
    curve : Curve
        The points that would be fitted, usually ``curve.loading()``.
    contact_depth : float, optional
        Depth reading (m) at contact, where it is known and not fitted.
    withdrawn : bool, default False
        Whether a curve of withdrawal alone is allowed, as for fits with adhesion.

    Raises
    ------
    CurveError
        Fewer than 8 points, NaN or infinity, a depth that never increases (nor is that of an unloading), a
        force that is the same everywhere, or no point beyond contact.
    """
    # Each point of a test in steps is the mean of a hold: one to five of them are a test.
    steps_alone = "equilibrium_share" in curve.metadata and 0 < len(curve) < MIN_POINTS
    if len(curve) < MIN_POINTS and not steps_alone:
        raise CurveError(
            f"{_named(curve)} has {len(curve)} points; at least {MIN_POINTS} are needed for a fit"
        )
    for name, column in (("depth", curve.depth), ("force", curve.force)):
        finite = np.isfinite(column)
        if not finite.all():
            bad = np.flatnonzero(~finite)
            raise CurveError(
                f"{_named(curve)}: {name} holds {column[bad[0]]} at point {bad[0]} ({bad.size} such points); "
                "remove them first"
            )
    if steps_alone and len(curve) == 1 and curve.force[0] != 0.0:
        return
    steps = curve.depth[1:] - curve.depth[:-1]
    comes_back = curve.segment is not None and bool((one_of_each(curve.segment) == UNLOADING).all())
    if not (steps if withdrawn else (steps < 0.0) if comes_back else (steps > 0.0)).any():
        held = curve.segment is not None and bool((curve.segment == HOLD).all())
        why = (
            "a hold alone does not show how stiff the sample is; take its ramp with it, such as step = 1 with "
            "segment = 'all' in [curve]"
            if held
            else "the depth never increases; check which column is the depth, and its sign"
        )
        raise CurveError(f"{_named(curve)}: {why}")
    deepest = float(np.abs(curve.depth).max())
    if deepest < SMALLEST_LENGTH:
        raise CurveError(
            f"{_named(curve)}: the largest depth is {deepest:.3g} m, which is not a physical length (at least "
            f"{SMALLEST_LENGTH:g} m); check the unit of the depth"
        )
    if not np.ptp(curve.force) > 0.0:
        value = "zero" if not curve.force.any() else f"the same ({curve.force[0]:.6g} N)"
        raise CurveError(
            f"{_named(curve)}: no contact, the force is {value} at every point; check which column is the force"
        )
    if contact_depth is not None and not (curve.depth > contact_depth).any():
        raise CurveError(
            f"{_named(curve)}: no point beyond contact: the deepest is {curve.depth.max():.6g} m, contact is "
            f"at {contact_depth:.6g} m"
        )


def _named(curve: Curve) -> str:
    name = curve.metadata.get("name")
    return f"curve {name!r}" if name else "the curve"


def _set(curve: Curve, name: str, value: Any) -> None:
    object.__setattr__(curve, name, value)


def _column(values: ArrayLike, name: str, length: int | None = None) -> FloatArray:
    try:
        # What nobody can write to is shared, a million points are not copied again for every part and note.
        array = values if _is_settled(values) else np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise CurveError(f"{name} must hold numbers; got {values!r:.80}") from error
    if array.ndim != 1:
        raise CurveError(f"{name} must be one column, shape (n,); got shape {array.shape}")
    if length is not None and len(array) != length:
        raise CurveError(f"{name} has {len(array)} points but depth has {length}")
    array.flags.writeable = False
    return array


def _picked(values: FloatArray, index: Any) -> FloatArray:
    """Return the values at `index` as a read-only copy."""
    picked = np.array(values[index]) if isinstance(index, slice) else np.asarray(values[index])
    picked.flags.writeable = False
    return picked


def _is_settled(values: ArrayLike) -> TypeGuard[FloatArray]:
    """Whether the values are a float64 array whose memory is read-only, which need not be copied."""
    if not isinstance(values, np.ndarray) or values.dtype != np.float64 or values.flags.writeable:
        return False
    owner: object = values.base  # an array, or a buffer of somebody else's
    return owner is None or (isinstance(owner, np.ndarray) and not owner.flags.writeable)


def _labels(values: ArrayLike, length: int) -> NDArray[np.str_]:
    # Widened to the longest label first: a narrower type would cut "unloading again" to a valid label.
    given = np.asarray(values)
    array = given if given.dtype.kind == "U" else np.array([str(value) for value in given], dtype=np.str_)
    if array.shape != (length,):
        raise CurveError(f"segment has {array.size} points but depth has {length}")
    if length and array.strides == (0,):  # one label for all, as `one_label` makes it
        return one_label(str(_labels(array[:1].copy(), 1)[0]), length)
    known = np.logical_or.reduce([array == label for label in _LABELS])
    if not known.all():
        unknown = min(map(str, array[~known]))
        raise CurveError(f"segment holds {unknown!r}; allowed are {', '.join(_LABELS)}")
    labels: NDArray[np.str_] = array.astype("<U9")
    labels.flags.writeable = False
    return labels


def recorded(curve: Curve) -> str:
    """Return instrument, software, date and time from the file's header in one line; empty if all are missing.

    Examples
    --------
    >>> from underlay import Curve
    >>> recorded(Curve([0.0, 1e-6], [0.0, 1e-6], metadata={"header": {"Device": "Chiaro", "Date": "12/05/2025"}}))
    'Chiaro, 12/05/2025'
    """
    for comment in curve.metadata.get("comments", ()):
        if str(comment).startswith(RECORDED):
            return str(comment)[len(RECORDED) :]
    header = curve.metadata.get("header", {})
    if not isinstance(header, Mapping):
        return ""
    entries = {str(key).strip().lower(): one_line(value).strip() for key, value in header.items()}
    found = [next((entries[word] for word in words if entries.get(word)), "") for words in _ENTRIES]
    return ", ".join(text for text in found if text)
