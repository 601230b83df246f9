"""`hypermap warm-up`: compile now what the first map or path would otherwise wait for."""

from __future__ import annotations

import time
from pathlib import Path

from hypermap.cli.finding_options import ProfileName
from hypermap.cli.terminal import note, say
from hypermap.text import counted

# Frames per second of the simulated drive: so few that it does not take long, with what is rare.
_RATES = {ProfileName.default: 0.5, ProfileName.thesis: 0.1}


def command() -> None:
    """Compile the code for maps, rooms and paths for this machine ahead of time.

    Otherwise, the first `demo`, `map`, `live`, `rooms` or `path` does this, and takes longer. This
    command maps a small simulated room with both profiles, and finds rooms, paths and frontiers in
    a small grid. In a Docker image, run it as root on the same type of processor: the cache next to
    the code then serves all users.

    Examples:
        hypermap warm-up
        RUN pip install hypermap && hypermap warm-up
    """
    from hypermap import _loops
    from hypermap._compiled import has_own_place

    began = time.monotonic()
    note("mapping a small simulated room, to compile all functions ...")
    _map_a_little()
    _find_a_little()
    seconds = time.monotonic() - began
    count = _loops.compiled_count()
    done = f"compiled {counted(count, 'function')} in {seconds:.0f} s"
    say(done if count else "everything is compiled already")
    folder, package = _loops.cache_folder(), Path(_loops.__file__).parent
    if folder is None:
        return  # a warning has said why nothing is kept
    if folder.is_relative_to(package):
        say(f"kept in {folder}, next to the code, for all users")
    else:
        say(f"kept in {folder}, for those who can write there")
        if not has_own_place():
            note(f"{package} cannot be written to; run this as its owner to compile for all users")


def _map_a_little() -> None:
    """Map a few frames with each profile."""
    from hypermap.mapping.config import profile
    from hypermap.mapping.recording_to_map import map_recording
    from hypermap.perception.detectors.sources import detections_from_recording
    from hypermap.simulation import SimulatedRecording, demo_world

    for each, rate in _RATES.items():
        recording = SimulatedRecording(demo_world(), rate=rate, has_occupancy=False)
        map_recording(recording, detections_from_recording(), profile(each.value))


def _find_a_little() -> None:
    """Find rooms, paths and a frontier: two rooms, one half unknown, with a gap between them."""
    import numpy as np

    from hypermap.core.grid import GridGeometry
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyLayer
    from hypermap.exploration import Explorer
    from hypermap.paths import PathSettings, Planner
    from hypermap.rooms.on_map import rooms_of_map

    cells = np.full((60, 120), FREE, dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = OCCUPIED
    cells[:40, 60] = OCCUPIED
    cells[:30, 61:90] = UNKNOWN
    floor = Hypermap([OccupancyLayer("occupancy", "map", GridGeometry(120, 60, 0.1), cells)])
    rooms_of_map(floor)
    start, goal = [1.0, 1.0], [10.0, 1.0]
    for settings in (PathSettings(), PathSettings(inflation_radius=0.3)):
        Planner(floor, settings).path(start, goal)
    Explorer(floor, start).frontiers()
