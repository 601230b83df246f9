"""What is not collected: modules that need the Python libraries of ROS already to be imported."""

collect_ignore_glob = [
    "src/hypermap/ros/ros1/*",
    "src/hypermap/ros/ros2/*",
    "src/hypermap/ros/rviz/bindings.py",
]
