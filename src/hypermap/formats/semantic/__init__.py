"""Semantic layers as files: YAML, GeoParquet, GeoJSON, CSV and GeoDataFrames; their evidence."""
