"""What the parts of a picture share: sizes, inks, and how wide a text is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextToPath

if TYPE_CHECKING:
    from hypermap.colors import Color

DPI = 144
SMALL, TITLE, NAME = 8.0, 13.0, 7.5  # points
FONT = "DejaVu Sans"  # comes with matplotlib, so that a picture is the same everywhere
INK, FAINT, PAPER = "#1c1c1c", "#6b6b6b", "#ffffff"
NOTE = (0.70, 0.11, 0.28)  # of the marks of notes
MARK = 11.5  # points across a mark
SHAPE_ALPHA = 0.55

_measure = TextToPath()


def text_width(text: str, points: float) -> float:
    """Return how wide a text is [pixels]."""
    font = FontProperties(family=FONT, size=points)
    width, _, _ = _measure.get_text_width_height_descent(text, font, ismath=False)
    return float(width) * DPI / 72


def fill_style(color: Color, alpha: float) -> dict[str, Any]:
    """Return how a shape of that color looks: filled, with a darker outline."""
    edge = tuple(0.65 * part for part in color)
    return {"facecolor": (*color, alpha), "edgecolor": edge, "linewidth": 0.9}


def line_style(color: Color) -> dict[str, Any]:
    """Return how a shape looks that is drawn as a line of that color."""
    return {"facecolor": "none", "edgecolor": color, "linewidth": 1.6}
