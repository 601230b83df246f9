"""The known families of networks.

Each is one `Layout`: how it wants the image, how to recognize its outputs, and how to turn them
into `Candidates`. A new one is two functions and a row in `yolo.py` or `detr.py`.
"""

from __future__ import annotations

from hypermap.perception.detectors import detr, yolo
from hypermap.perception.detectors.layout import Layout, Outputs

LAYOUTS = (*yolo.LAYOUTS, *detr.LAYOUTS)


def recognize(outputs: Outputs) -> Layout:
    """Return the family that has such outputs.

    Raises:
        ValueError: If there is none.
    """
    for layout in LAYOUTS:
        if layout.fits(outputs):
            return layout
    raise ValueError("no known layout fits")
