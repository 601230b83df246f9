"""No ROS: a port over the WebSocket of Foxglove and Lichtblick."""
