"""Encoders of images and texts, by which objects are found that look like a description."""
