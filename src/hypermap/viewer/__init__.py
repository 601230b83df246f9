"""What one sees of a map: pictures in PNG and SVG."""
