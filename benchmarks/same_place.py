"""Whether `map --onto` tells a drive through another place from one through the same place.

Drives two days later through changing worlds are each compared with a map of the first day: of
their own world, and of all others; each with the occupancy made from depth and with that of a
laser. Prints how many were refused, how many were mapped with a warning, and which drives were told
wrongly.

    python benchmarks/same_place.py [--worlds demo,lab,...] [--levels robot,harsh] [--seed 60]
                                    [--rate 1]
"""

from __future__ import annotations

import argparse
import itertools
import logging
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.mapping.config import MappingConfig, profile
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.perceived import Perceived
from hypermap.mapping.same_place import OtherPlace, PlaceCheck
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import RgbdFrame
from hypermap.simulation import SimulatedRecording, World, built_in_world, errors_of_level, varied
from hypermap.simulation.days import Day, next_day

_WORLDS = "apartment,corridor,demo,kitchen,lab,office"
_SOURCE = detections_from_recording()


@dataclass(frozen=True, eq=False)
class Drive:
    """What each frame of a drive shows.

    Attributes:
        name: of the drive.
        world: its name.
        frames: the mapped frames.
    """

    name: str
    world: str
    frames: Sequence[tuple[RgbdFrame, Perceived]]


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", default=_WORLDS)
    parser.add_argument("--levels", default="robot,harsh")
    parser.add_argument("--seed", type=int, default=60)
    parser.add_argument("--rate", type=float, default=1.0)
    given = parser.parse_args()
    logging.getLogger("hypermap").setLevel(logging.ERROR)
    names, config = given.worlds.split(","), profile("default")
    bases = {name: first_maps(name, given.seed, given.rate) for name in names}
    told: Counter[tuple[str, str]] = Counter()
    for name, level in itertools.product(names, given.levels.split(",")):
        drive = later_drive(name, level, given.seed, given.rate)
        for other, kind in itertools.product(names, ("depth", "laser")):
            what = "the same place" if other == name else "another place"
            result = told_of(drive, bases[other][kind], config)
            told[what, result] += 1
            if (what == "another place") != (result == "refused"):
                print(f"{drive.name} onto {other}, {kind}: {result}", flush=True)
    for (what, result), count in sorted(told.items()):
        print(f"{what}: {count} {result}")


def first_maps(name: str, seed: int, rate: float) -> dict[str, Hypermap]:
    """Return the map of a world's first day, with an occupancy layer from depth, and of a laser."""
    world = varied(built_in_world(name), seed)
    mapper = Mapper(profile("default"), _SOURCE, drive="first")
    for frame in recording_of(world, "robot", 1000 * seed, rate, False).frames():
        mapper.add(frame)
    depth = mapper.hypermap()
    walls = recording_of(world, "robot", 1000 * seed, rate, True).occupancy()
    assert isinstance(walls, OccupancyLayer)  # as it was asked for
    return {"depth": depth, "laser": Hypermap([walls, depth.semantic()])}


def later_drive(name: str, level: str, seed: int, rate: float) -> Drive:
    """Return a drive two days later, when things have changed."""
    day = Day.first(varied(built_in_world(name), seed))
    for number in (1, 2):
        day = next_day(day, 1000 * seed + number)
    mapper = Mapper(profile("default"), _SOURCE)
    recording = recording_of(day.world, level, 1000 * seed + 2, rate, False)
    frames = (
        one for one in recording.frames() if mapper.keyframes.accept(one.map_T_camera, one.stamp)
    )
    return Drive(f"{name}, {level}", name, [(one, mapper.perceiver(one)) for one in frames])


def recording_of(
    world: World, level: str, seed: int, rate: float, has_occupancy: bool
) -> SimulatedRecording:
    """Return a recording of a drive through a world."""
    return SimulatedRecording.with_errors(
        world, errors_of_level(level), rate=rate, seed=seed, has_occupancy=has_occupancy
    )


def told_of(drive: Drive, before: Hypermap, config: MappingConfig) -> str:
    """Return what mapping a drive onto a map says: mapped, mapped with a warning, or refused."""
    check = PlaceCheck(before, config.occupancy)
    try:
        for frame, perceived in drive.frames:
            check.check(drive.name)
            check.add(frame, perceived)
        check.check(drive.name, is_last=True)
    except OtherPlace:
        return "refused"
    return "mapped" if check.likeness is not None and check.likeness.fits else "mapped, warned"


if __name__ == "__main__":
    main()
