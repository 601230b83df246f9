"""The map itself: layers, frames and questions. Knows numpy and shapely alone."""
