"""ROS 2: a port over rclpy."""
