"""Figures of a fit. Each function returns a matplotlib `Figure`; `png` and `svg` turn it into bytes."""

from hydroid.report.plots.identifiability import told
from hydroid.report.plots.parameters import estimates, runs
from hydroid.report.plots.search import learning, pareto
from hydroid.report.plots.style import png, svg
from hydroid.report.plots.traces import response, validation

__all__ = ["estimates", "learning", "pareto", "png", "response", "runs", "svg", "told", "validation"]
