"""Converts ROS messages to our types.

The functions read fields by name, so they accept the messages of any ROS library, of ROS 1 and
ROS 2. They raise a FormatError that says what is wrong; the caller adds the topic and time.
"""
