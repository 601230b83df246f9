"""Occupancy layers as files: what ROS' map_server reads, pictures, GeoTIFF."""
