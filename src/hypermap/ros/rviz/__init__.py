"""Maps in rviz: its configuration, and a window that follows a map server."""
