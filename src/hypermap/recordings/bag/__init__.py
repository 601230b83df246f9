"""ROS bags, read through rosbags; no ROS is needed."""
