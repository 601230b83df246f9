"""`hypermap ros1-env`: our messages for the tools of ROS 1."""

from __future__ import annotations

import shlex

from hypermap.cli.terminal import say


def command() -> None:
    """Print what makes rosmsg, rostopic and rosservice know the messages of Hypermap.

    Needed where the package hypermap_msgs has not been built with catkin: its Python classes are
    generated into the user's cache. Where an installed package has all, nothing is printed.

    Examples:
      eval "$(hypermap ros1-env)"
      rosservice call /hypermap_server/get_string_at_point '{layer: rooms}'
    """
    import hypermap.ros.ros1.libraries  # noqa: F401 - says what is missing
    from hypermap.ros.ros1.messages import environment

    for name, folders in environment().items():
        value = ":".join(shlex.quote(str(folder)) for folder in folders)
        say(f'export {name}={value}"${{{name}:+:${name}}}"')
