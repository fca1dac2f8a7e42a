"""Where linear elasticity has nothing to say: a tip pressed deeper than the layer is thick."""

from __future__ import annotations

from dataclasses import dataclass

from underlay.units import format_quantity

__all__ = ["DeeperThanLayer"]


@dataclass(frozen=True)
class DeeperThanLayer:
    """A tip goes deeper than the layer is thick.

    Every law here is linear in the displacements. On a rigid base such a tip would stand inside the base; on a
    soft one a film may bend that far, and its stretch is not in the law. The numbers are those of the linear
    problem, so they are given, and doubted: a sample is not fitted worse for being refused.

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
        """The doubt, None where the tip stays within the thickness."""
        return cls(depth, thickness) if depth > thickness else None

    def __str__(self) -> str:
        return (
            f"the tip goes {format_quantity(self.depth, 'length')} deep into a layer "
            f"{format_quantity(self.thickness, 'length')} thick, where linear elasticity says nothing true: use "
            "less of the curve ([curve] max_depth), or check depth, thickness and their units"
        )
