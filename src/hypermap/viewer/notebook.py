"""A map in a notebook: a table of its layers, and a picture."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING

from hypermap.core.errors import HypermapError
from hypermap.viewer.picture import compose

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap

_PIXELS = 700  # of the map's longer side


def map_as_html(hypermap: Hypermap) -> str:
    """Return a table of the layers, and the picture, or why there is none."""
    rows = "".join(
        f"<tr><td>{escape(layer.name)}</td><td>{escape(type(layer).__name__)}</td>"
        f"<td>{escape(layer.summary())}</td><td>{escape(layer.frame_id)}</td></tr>"
        for layer in hypermap
    )
    head = "<tr><th>layer</th><th>kind</th><th>holds</th><th>frame</th></tr>"
    return f"<div><table>{head}{rows}</table>{_picture(hypermap)}</div>"


def map_as_png(hypermap: Hypermap) -> bytes | None:
    """Return the picture; None where there is nothing to draw."""
    try:
        return _png(hypermap)
    except HypermapError:
        return None


def _picture(hypermap: Hypermap) -> str:
    try:
        data = base64.b64encode(_png(hypermap)).decode("ascii")
    except HypermapError as error:
        return f"<p>{escape(str(error))}</p>"
    return f'<img alt="the map from above" src="data:image/png;base64,{data}">'


def _png(hypermap: Hypermap) -> bytes:
    drawing = compose(hypermap)
    from hypermap.viewer.drawing import draw  # loads matplotlib

    return draw(drawing, "png", _PIXELS)
