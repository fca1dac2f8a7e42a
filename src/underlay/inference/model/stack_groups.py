"""Parameter sets of a stack, gathered so that each group shares the nodes of one `ExactBatch`.

As in `exact_groups`, the groups' limits are fixed numbers: a set's answer does not depend on the company it is
asked in. Sets share nodes when every ratio of moduli and of thicknesses that varies lies within a factor, and so
does their range; the nodes are proved by doubling at the group's middle, at a tenth of the tolerance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.inference.model.parameter_sets import ParameterSets
from underlay.mechanics.exact.batch import ExactBatch
from underlay.mechanics.exact.contact_problem import depth_measure
from underlay.mechanics.kernel import StackKernel
from underlay.mechanics.kernel.recursion import Recursion
from underlay.mechanics.kernel.stack import sheets_of
from underlay.mechanics.plane_constants import (
    PlaneConstants,
    isotropic_constants,
    transversely_isotropic_constants,
)

__all__ = ["has_stack_batches", "stack_groups", "stacked"]

# As for `exact_groups`, with narrower ratios: of 32 sets each of a stiff, a soft and a slipping stack, at 1e-3 and
# 1e-6, the largest error was 0.11 of the tolerance.
_RATIO_STEP, _RANGE_STEP, _MARGIN, _SPARE = 2.0, 2.0, 1.1, 0.1
# With more of them a group holds few sets.
_MOST_RATIOS = 4


def has_stack_batches(asked: ParameterSets) -> bool:
    """Whether the sets are of a stack under a power law, and differ in moduli and thicknesses alone."""
    similarity, laws = asked.forward.similarity, asked.forward.laws
    if not (isinstance(laws.contact.kernel, StackKernel) and laws.solver.has_table(laws.contact)):
        return False
    if similarity.exponent is None or any(asked.varies(path) for path in similarity.direct):
        return False
    return 0 < len(_varying(asked)) <= _MOST_RATIOS


def _varying(asked: ParameterSets) -> dict[str, FloatArray]:
    """Ratios that differ between the sets, (sets,) each, by the path that a reference law is built with."""
    similarity = asked.forward.similarity
    # `reduced` divides arrays as it does numbers.
    values: Any = asked.values
    ratios: Sequence[Any] = similarity.reduced(values)
    numbers = zip(similarity.ratio_paths, ratios, strict=True)
    return {path: ratio for path, ratio in numbers if isinstance(ratio, np.ndarray)}


def stack_groups(asked: ParameterSets) -> Iterator[tuple[NDArray[np.intp], ExactBatch | None]]:
    """Rows whose ratios and range are alike, with what is compiled for them; None where no law reaches them."""
    ratios = _varying(asked)
    thickness = asked.column("layer.thickness")[:, 0]
    ranges = np.ceil(np.log(np.maximum(_MARGIN * asked.varpi(thickness), 1e-3)) / np.log(_RANGE_STEP))
    steps = [np.round(np.log(ratio) / np.log(_RATIO_STEP)) for ratio in ratios.values()]
    keys = np.column_stack([*steps, ranges])
    for key in np.unique(keys, axis=0):
        rows = np.flatnonzero((keys == key).all(axis=1))
        middle = dict(zip(ratios, np.power(_RATIO_STEP, key[:-1]).tolist(), strict=True))
        yield rows, _compiled(asked, middle, float(key[-1]))


def _compiled(asked: ParameterSets, middle: dict[str, float], octave: float) -> ExactBatch | None:
    laws = asked.forward.laws
    key = ("stack batch", laws.number, tuple(middle.items()), octave)
    if key not in laws.store.batches:
        scene = asked.forward.similarity.scene
        thickness = scene.layer.thickness
        depth = float(depth_measure(scene.indenter).abel(np.array(_RANGE_STEP**octave * thickness)))
        try:
            kernel = scene.with_values(middle).contact.kernel
            laws.store.batches[key] = ExactBatch.compile_for(
                scene.indenter, kernel, thickness=thickness, max_depth=depth, rtol=_SPARE * asked.rtol
            )
        except InputError:
            laws.store.batches[key] = None
    return laws.store.batches[key]


def stacked(asked: ParameterSets, rows: NDArray[np.intp]) -> tuple[Recursion, FloatArray]:
    """The kernel of some of the sets, and theta of their surfaces (Pa), (rows,)."""
    kernel = asked.forward.laws.contact.kernel
    if not isinstance(kernel, StackKernel):
        raise TypeError(f"no stack: {kernel.description}")
    parts = ["layer", *(f"substrate.layers[{number}]" for number in range(len(kernel.layers) - 1))]
    constants = [_constants(asked, part, rows) for part in parts]
    base = None if kernel.base.plane_constants is None else _constants(asked, "substrate", rows)
    thicknesses = [asked.column(f"{part}.thickness")[rows] for part in parts]
    bonds = [layer.bond for layer in kernel.layers]
    return Recursion(*sheets_of(constants, base, thicknesses, bonds)), np.asarray(constants[0].theta)[:, 0]


def _constants(asked: ParameterSets, part: str, rows: NDArray[np.intp]) -> PlaneConstants:
    """Plane constants of one part, entries (rows, 1)."""
    axial = f"{part}.E_axial" in asked.values
    names = ("E", "E_axial", "nu", "nu_axial", "G_axial") if axial else ("E", "nu")
    numbers = [asked.column(f"{part}.{name}")[rows] for name in names]
    return (transversely_isotropic_constants if axial else isotropic_constants)(*numbers)
