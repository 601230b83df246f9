"""`hypermap rviz`: look at a map that a server publishes, in rviz or rviz2."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from hypermap.cli.options import Force, check_output
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError

_NO_RVIZ2 = "rviz2 is missing: source the setup.bash of ROS 2; it comes with ros-DISTRO-rviz2"


def command(
    path: Annotated[
        Path | None,
        typer.Argument(
            metavar="[MAP]",
            readable=False,
            show_default=False,
            help="The map that the server publishes; rviz then shows all of it from the start.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            show_default=False,
            help="Save here: a configuration for MAP, .rviz. Opens no window.",
        ),
    ] = None,
    ros2: Annotated[bool, typer.Option("--ros2", help="Use ROS 2: starts rviz2.")] = False,
    server: Annotated[
        str, typer.Option("--server", metavar="NODE", help="Full name of the map server node.")
    ] = "/hypermap_server",
    force: Force = False,
) -> None:
    """Show a served map in rviz: one display per layer, with a switch for each class.

    On ROS 1 the window follows the server: displays appear and disappear with its layers. On ROS 2,
    rviz2 starts with a configuration made for MAP. Objects have the colors of hypermap render.

    Examples:
        hypermap rviz
        hypermap rviz lab.hmap --server /robot/hypermap_server
        hypermap rviz lab.hmap -o lab.rviz
        hypermap rviz lab.hmap --ros2
    """
    from hypermap.formats import open_map
    from hypermap.ros.rviz.config import map_configuration, view_of

    node = "/" + server.strip("/")
    shown = None if path is None else open_map(path)
    if output is not None:
        if shown is None:
            raise HypermapError("-o: name the map that the configuration is for")
        check_output(output, force)
        output.write_text(map_configuration(shown, node, ros2=ros2), encoding="utf-8")
        note(f"saved {output}")
        return

    from hypermap.ros.nodes import found_middleware

    if not ros2 and found_middleware() == "ros1":
        from hypermap.ros.ros1.port import Ros1Port
        from hypermap.ros.rviz.window import follow

        name = f"hypermap_rviz_{os.getpid()}"  # there may be several windows
        follow(Ros1Port(name, [name]), node, None if shown is None else view_of(shown))
        return
    if shown is None:
        raise HypermapError("on ROS 2, name the map: rviz2 shows the layers that it has")
    _run_rviz2(map_configuration(shown, node, ros2=True))


def _run_rviz2(configuration: str) -> None:
    program = shutil.which("rviz2")
    if program is None:
        raise HypermapError(_NO_RVIZ2)
    with tempfile.TemporaryDirectory(prefix="hypermap-") as folder:
        file = Path(folder) / "map.rviz"
        file.write_text(configuration, encoding="utf-8")
        code = subprocess.run([program, "-d", str(file)], check=False).returncode
    if code:
        raise HypermapError(f"rviz2 ended with exit code {code}")
