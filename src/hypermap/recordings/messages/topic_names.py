"""What the names of image topics tell."""

from __future__ import annotations

_TRANSPORTS = ("/compressedDepth", "/compressed")  # of image_transport


def image_name(topic: str) -> str:
    """Return the image topic of which a compressed topic is the transport.

    >>> image_name("/camera/depth/image_raw/compressedDepth")
    '/camera/depth/image_raw'
    """
    for transport in _TRANSPORTS:
        topic = topic.removesuffix(transport)
    return topic


def image_folder(topic: str) -> str:
    """Return the namespace of an image topic, in which its camera info is, too.

    >>> image_folder("/camera/depth/image_raw/compressedDepth")
    '/camera/depth'
    """
    return image_name(topic).rpartition("/")[0]


def names_rectified(topic: str) -> bool:
    """Return whether the images of a topic are rectified, as its name tells.

    >>> names_rectified("/rgb/image_rect_color/compressed"), names_rectified("/rect/image_raw")
    (True, False)
    """
    return "rect" in image_name(topic).rpartition("/")[2]
