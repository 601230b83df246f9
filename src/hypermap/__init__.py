"""Hypermap: maps for robots that hold more than free and occupied."""

import logging

from hypermap._version import __version__

logging.getLogger(__name__).addHandler(logging.NullHandler())

__all__ = ["__version__"]
