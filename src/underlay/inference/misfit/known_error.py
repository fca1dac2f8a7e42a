"""An error that the contact law is known to have, of a size that is only roughly known.

A paraboloid stands for a sphere, a frictionless law for a tip that sticks, small strains for finite ones: the
shape of such an error over the depth can be computed, its size is uncertain, and no residual tells it from another
thickness. It enters a fit as a column with a prior,

    reading = F(theta) + sum_i amplitude_i column_i(theta) + ...,   amplitude_i ~ N(mean_i, deviation_i^2),

solved for together with the parameters and averaged over (`competition.py`): the interval of every parameter
is as wide as the error makes it, and a mean that is not zero moves its middle.

To add one, write a module with a column and a function that says for which scenes it counts, and name that function
in `known_errors.py`:

    def _column(test: Pressed) -> FloatArray:
        return 0.05 * test.force * test.law.contact_radius(test.depth) / test.values["indenter.radius"]

    def soft_tip(scene: Scene) -> KnownError | None:
        if not isinstance(scene.indenter, Sphere):
            return None
        return KnownError("the tip gives way", _column, mean=1.0, deviation=0.5)

A column is the force (N) that the error adds to the law at amplitude one, smooth in depth and zero up to contact.
It follows the present law: depths, contact radii and forces are those of the vector at hand, and it is asked again
wherever the fit goes. Where the error is known only up to a sign take mean 0; where theory gives its size, mean 1
and the share by which theories differ. Curves of a joint fit share the amplitude of an error, by its words.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

from underlay._arrays import FloatArray
from underlay.errors import InputError
from underlay.mechanics.contact_law import ContactLaw
from underlay.mechanics.solver import Solver
from underlay.scene.scene import Scene

__all__ = ["Column", "KnownError", "Pressed"]


@dataclass(frozen=True)
class Pressed:
    """A test at the present values of its parameters.

    Parameters
    ----------
    values : mapping of str to float
        Every number of the scene (SI), by its path.
    law : ContactLaw
        Its law.
    depth : FloatArray
        Indentation depth w (m), (n,), negative before contact.
    force, stiffness : FloatArray
        Contact force P (N) of the law and dP/dw (N/m), each (n,).
    made : callable
        Makes the scene of the values.
    by : callable
        Law of the same contact by another solver, kept from one call to the next as the law's own is.
    """

    values: Mapping[str, float]
    law: ContactLaw
    depth: FloatArray
    force: FloatArray
    stiffness: FloatArray
    made: Callable[[], Scene]
    by: Callable[[Solver], ContactLaw]

    @cached_property
    def scene(self) -> Scene:
        """With those values; made when it is asked for, since a column is asked at every step of a search."""
        return self.made()


#: Force (N), (n,), that an error of amplitude one adds.
Column: TypeAlias = Callable[[Pressed], FloatArray]


@dataclass(frozen=True)
class KnownError:
    """An error of the law with a known shape and a prior of its size.

    Parameters
    ----------
    words : str
        What it is, to complete "the intervals allow for ...".
    column : callable
        Force (N) at amplitude one, (n,), of a `Pressed`.
    mean, deviation : float
        Of the normal prior of the amplitude; the deviation positive.
    told : tuple of str
        What people are told that it is part of; by default its words.

    Raises
    ------
    InputError
        If the deviation is not positive.
    """

    words: str
    column: Column
    mean: float = 0.0
    deviation: float = 1.0
    told: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse a prior that is none."""
        if not self.deviation > 0.0:
            raise InputError(
                f"deviation of {self.words!r} must be positive; got {self.deviation!r}: an error of exactly known "
                "size belongs into the law"
            )
