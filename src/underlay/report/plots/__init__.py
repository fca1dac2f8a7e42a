"""Pictures: each function takes ``ax=`` (or makes one), draws, and returns the axes; none shows a window."""

from underlay.report.plots.accuracy import accuracy_cost, answer_cost, posterior_cost, what_accuracy_costs
from underlay.report.plots.adhesion import adhesion
from underlay.report.plots.corner import corner
from underlay.report.plots.correlations import correlations
from underlay.report.plots.effects import effects
from underlay.report.plots.film import film
from underlay.report.plots.fit import fit, fit_in_time, fit_log
from underlay.report.plots.histogram import histogram
from underlay.report.plots.identifiability import identifiability
from underlay.report.plots.laws import laws
from underlay.report.plots.map import map  # noqa: A004  the public name
from underlay.report.plots.plan import plan
from underlay.report.plots.pointwise import pointwise_modulus
from underlay.report.plots.population import population
from underlay.report.plots.predictive import predictive
from underlay.report.plots.profile import profile
from underlay.report.plots.relaxation import relaxation
from underlay.report.plots.scene import scene
from underlay.report.plots.segments import segments
from underlay.report.plots.style import save
from underlay.report.plots.survey import survey, verdicts

__all__ = [
    "accuracy_cost",
    "adhesion",
    "answer_cost",
    "corner",
    "correlations",
    "effects",
    "film",
    "fit",
    "fit_in_time",
    "fit_log",
    "histogram",
    "identifiability",
    "laws",
    "map",
    "plan",
    "pointwise_modulus",
    "population",
    "posterior_cost",
    "predictive",
    "profile",
    "relaxation",
    "save",
    "scene",
    "segments",
    "survey",
    "verdicts",
    "what_accuracy_costs",
]
