"""For tests, ours and those of plug-ins: builders, comparisons, strategies, the layer contract.

`hypermap.testing.strategies` needs hypothesis, and `hypermap.testing.contract` needs pytest.
"""

from hypermap.testing.builders import jpeg_picture, occupancy_from_text, square
from hypermap.testing.comparing import (
    assert_same_evidence,
    assert_same_layer,
    assert_same_map,
    assert_same_objects,
)

__all__ = [
    "assert_same_evidence",
    "assert_same_layer",
    "assert_same_map",
    "assert_same_objects",
    "jpeg_picture",
    "occupancy_from_text",
    "square",
]
