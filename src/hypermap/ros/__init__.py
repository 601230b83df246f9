"""On a robot: the map server and the semantic mapper as ROS nodes.

A node is one class on a `Port`, without any ROS import; `ros1`, `ros2` and `foxglove` are ports.
"""
