"""Distance of every marker to the model: one bar a marker."""

from typing import TYPE_CHECKING

import numpy as np

from biodance.pipeline.results import MarkerFit
from biodance.report.style import BLACK, SKY, figure, look

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def marker_figure(fit: MarkerFit) -> "Figure":
    """Draw the RMS distance (bar) and the largest distance (short line) of every seen marker in mm, the worst first."""
    seen = np.flatnonzero(np.isfinite(fit.rms))
    order = seen[np.argsort(-fit.rms[seen], kind="stable")]
    with look():
        drawn = figure(2.0)
        axes = drawn.subplots()
        place = np.arange(order.size)
        axes.bar(place, 1000 * fit.rms[order], width=0.75, color=SKY, edgecolor=BLACK, linewidth=0.5, label="RMS over the trial")
        axes.plot(place, 1000 * fit.max[order], linestyle="", marker="_", color=BLACK, markersize=7, label="largest")
        axes.set_xticks(place, [fit.names[i] for i in order], rotation=90, fontsize=7)
        axes.set_xlim(-0.6, max(order.size, 1) - 0.4)
        axes.grid(visible=False, axis="x")
        axes.set_ylim(0.0, max(1.0, 1050 * float(np.max(fit.max[order], initial=0.0))))
        axes.set_ylabel("distance (mm)")
        axes.legend(loc="upper right", ncols=2)
    return drawn
