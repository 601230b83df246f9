"""Pictures of maps in PNG and SVG, pages and logs."""
