"""Pictures: each function takes ``ax=`` (or makes one), draws, and returns the axes; none shows a window."""

from underlay.report.plots.correlations import correlations
from underlay.report.plots.fit import fit
from underlay.report.plots.scene import scene
from underlay.report.plots.style import save

__all__ = ["correlations", "fit", "save", "scene"]
