"""ROS messages become our types.

The functions read fields by name, so they take the messages of any ROS library, and ROS 1 and
ROS 2 alike. They raise a FormatError that says what is wrong; the caller knows the topic and time.
"""
