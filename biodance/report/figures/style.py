"""The look of all figures, and how a figure becomes the same bytes every time."""

from base64 import b64encode
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any, Literal

from biodance.display import BLUE, GREY, RED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIDE_COLOURS: dict[str, tuple[str, Literal["-", "--"]]] = {
    "left": (RED, "--"),
    "right": (BLUE, "-"),
    "middle": (GREY, "-"),
}
"""Colour and line style of the body's sides: never the colour alone."""

FIGURE_WIDTH = 7.1
"""Width of a figure, inch: an A4 page less its margins."""

LOOK: dict[Any, Any] = {
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.labelsize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.hashsalt": "biodance",
    "svg.fonttype": "path",
}


@contextmanager
def look() -> Iterator[None]:
    """Draw and save with the house's settings; matplotlib's own settings come back afterwards."""
    import matplotlib

    with matplotlib.rc_context(LOOK):
        yield


def figure(height: float) -> "Figure":
    """Return an empty figure of ``height`` inch that belongs to no window."""
    from matplotlib.figure import Figure

    return Figure(figsize=(FIGURE_WIDTH, height), layout="constrained")


def svg_address(drawn: "Figure") -> str:
    """Return ``drawn`` as an image's address (``data:image/svg+xml``): the same figure gives the same characters."""
    stream = BytesIO()
    with look():
        drawn.savefig(stream, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + b64encode(stream.getvalue()).decode("ascii")
