"""Reads RGB-D frames from recordings on disk: image folders and ROS bags."""

from hypermap.recordings.open import open_recording
from hypermap.recordings.options import RecordingOptions

__all__ = ["RecordingOptions", "open_recording"]
