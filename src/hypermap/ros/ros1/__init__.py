"""ROS 1: a port over rospy, and its messages."""
