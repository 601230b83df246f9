"""Recordings on disk become RGB-D frames."""
