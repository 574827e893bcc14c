# SPDX-License-Identifier: Apache-2.0
"""The colours of everything drawn, the style of figures, and writing a figure to a file."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # it is imported only where a figure is drawn
    from matplotlib.figure import Figure

# Okabe and Ito's palette: told apart with every common colour vision.
BLUE, ORANGE, VERMILLION, GREEN, PURPLE = "#0072B2", "#E69F00", "#D55E00", "#009E73", "#AA4499"
SKY, PINK = "#56B4E9", "#CC79A7"
INK, GREY, PALE = "#222222", "#777777", "#EDEDED"
PLATE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.9, "pad": 1.5}

_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.labelsize": 9.5,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "text.color": INK,
    "text.parse_math": False,  # a title may hold a $
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 9.0,
}

# What a file would say of the program or of the time, by its form.
_STAMP = {"png": "Software", "svg": "Date", "pdf": "CreationDate"}


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue of a colour, 0 to 255."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue


@contextmanager
def house_style() -> Iterator[None]:
    """The package's style, whatever the user has set."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        yield


def empty_figure(width: float, height: float) -> "Figure":
    """A figure [inches] that needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def png(figure: "Figure") -> bytes:
    """The figure as PNG."""
    return picture(figure, "png")


def picture(figure: "Figure", form: str) -> bytes:
    """The figure as png (150 pixels per inch), svg or pdf; its bytes depend on it and on matplotlib's version only."""
    import matplotlib

    buffer = BytesIO()
    with matplotlib.rc_context(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph")  # a title may have characters that the font has not: boxes
        matplotlib.rcdefaults()
        matplotlib.rcParams["svg.hashsalt"] = "skydiver_utc"
        figure.savefig(buffer, format=form, dpi=150, metadata={_STAMP[form]: None})
    return buffer.getvalue()


def short(value: float) -> str:
    """Three digits or so of a value that is not negative."""
    return f"{value:.2f}" if value < 10.0 else f"{value:.1f}" if value < 100.0 else f"{value:.0f}"
