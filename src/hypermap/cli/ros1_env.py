"""`hypermap ros1-env`: our messages for the tools of ROS 1."""

from __future__ import annotations

import shlex

from hypermap.cli.terminal import say


def command() -> None:
    """Print environment variables for rosmsg, rostopic and rosservice to find Hypermap's messages.

    You need this if the package hypermap_msgs was not built with catkin. Its Python classes are
    then generated into your cache. Prints nothing if an installed package has them.

    Examples:
      eval "$(hypermap ros1-env)"
      rosservice call /hypermap_server/get_string_at_point '{layer: rooms}'
    """
    import hypermap.ros.ros1.libraries  # noqa: F401 - says what is missing
    from hypermap.ros.ros1.messages import environment

    for name, folders in environment().items():
        value = ":".join(shlex.quote(str(folder)) for folder in folders)
        say(f'export {name}={value}"${{{name}:+:${name}}}"')
