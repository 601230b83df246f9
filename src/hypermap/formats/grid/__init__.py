"""Occupancy layers as files: ROS map_server maps, images, GeoTIFF."""
