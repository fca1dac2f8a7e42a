"""What a fit states of itself: intervals, verdict, and what the numbers stand on. Computed when asked, and once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from underlay._arrays import FloatArray
from underlay._given import require_level
from underlay._threads import one_thread
from underlay.errors import InputError
from underlay.inference.headline.averaged import averaged_fit, averaged_interval
from underlay.inference.headline.derived import band, derived_interval, derived_value
from underlay.inference.headline.known_inputs import sensitivity
from underlay.inference.headline.other_bonds import OtherBond, Refit, bracket, other_bonds, stated_bonds
from underlay.inference.headline.plain import correlated_interval, is_about
from underlay.inference.headline.verdict import verdict
from underlay.inference.headline.widened import Widened, widened, wider_interval
from underlay.inference.least_squares.fit_result import (
    AllowedFor,
    Fit,
    Follows,
    StatedBonds,
    StatedInterval,
    Statements,
    Verdict,
)
from underlay.inference.misfit.averaging import Averaged

__all__ = ["Headline"]

_LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class Headline(Statements):
    """Statements of one fit.

    Parameters
    ----------
    fit : Fit
        The fit.
    refit : callable
        Fits a problem: the same data with another bond.
    """

    fit: Fit
    refit: Refit
    _intervals: dict[tuple[str, float, bool], StatedInterval] = field(default_factory=dict, init=False)

    @one_thread()
    def interval(self, name: str, level: float, *, model_error: bool = False) -> StatedInterval:
        """Interval of a parameter; see `Fit.interval`."""
        require_level(level)
        key = (name, level, model_error)
        if key not in self._intervals:
            self._intervals[key] = self._wider(name, level) if model_error else self._found(name, level)
        return self._intervals[key]

    def _wider(self, name: str, level: float) -> StatedInterval:
        known, found = self.interval(name, level), self._widened.averaged
        if found is not None:
            known = wider_interval(self.fit, found, known, name, level)
        return bracket(
            known, self._other_bonds, find=lambda other: other.interval(name, level, model_error=True)
        )

    @cached_property
    def _widened(self) -> Widened:
        return widened(self.fit)

    @cached_property
    def _other_bonds(self) -> tuple[OtherBond, ...]:
        return other_bonds(self.fit, self.refit)

    @property
    def allowed_for(self) -> AllowedFor:
        """What the interval with model error allows for."""
        told = self._widened.allowed_for
        fitted = tuple(other.words for other in self._other_bonds if other.fit is not None)
        refused = tuple(f"{other.words} ({other.refused})" for other in self._other_bonds if other.refused)
        return replace(told, allowed=(*told.allowed, *fitted), unknown=(*told.unknown, *refused))

    @cached_property
    @one_thread()
    def bonds(self) -> tuple[StatedBonds, ...]:
        """What each bond gives, of every face of which nobody knows how it holds."""
        return stated_bonds(self.fit, self._other_bonds)

    @one_thread()
    def band(self, of: Follows, level: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Lower ends, middles and upper ends, (n,), of quantities that follow; see `Fit.band`."""
        require_level(level)
        return band(self.fit, self.averaged, of, level)

    def _found(self, name: str, level: float) -> StatedInterval:
        if name not in self.fit.names:
            if self.strays:
                return derived_interval(self.fit, None, name, level)
            found = derived_interval(self.fit, self.averaged, name, level)
            return replace(found, value=derived_value(self.fit, name))
        averaged = self._averaged_of(name, level)
        if averaged is None or not is_about(self.fit, averaged):
            return correlated_interval(self.fit, name, level)
        return replace(averaged, value=self.fit.values[name])

    @cached_property
    def strays(self) -> bool:
        """Whether residuals hang together, and averaging over that leaves what is printed of a parameter."""
        if not any(entry.correlated for entry in self.fit.diagnostics):
            return False
        for name in self.fit.names:
            found = self._averaged_of(name, _LEVEL)
            if found is not None and not is_about(self.fit, found):
                printed = self.interval(name, _LEVEL)
                if not printed.low <= found.value <= printed.high:
                    return True
        return False

    def _averaged_of(self, name: str, level: float) -> StatedInterval | None:
        """Interval averaged over what the residuals may be; None where there is none."""
        if self.averaged is None:
            return None
        try:
            return averaged_interval(self.fit, self.averaged, name, level)
        except InputError:
            # The optimum under correlated noise lies where there is no law to walk from.
            return None

    @cached_property
    @one_thread()
    def averaged(self) -> Averaged | None:
        """The fit averaged over what its residuals may be; None where its noise was stated."""
        return averaged_fit(self.fit)

    @cached_property
    @one_thread()
    def verdict(self) -> Verdict:
        """Whether the fit is to be believed."""
        return verdict(self.fit, self.averaged, lambda name: self.interval(name, _LEVEL), strays=self.strays)

    @cached_property
    def sensitivity(self) -> Mapping[str, Mapping[str, float]]:
        """d ln(value) / d ln(input)."""
        return sensitivity(self.fit)
