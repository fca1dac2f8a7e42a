"""Pictures: each function takes ``ax=`` (or makes one), draws, and returns the axes; none shows a window."""

from underlay.report.plots.fit import fit
from underlay.report.plots.style import save

__all__ = ["fit", "save"]
