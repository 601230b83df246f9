"""What a user asks an experiment for: worlds, drives, errors and methods."""

from __future__ import annotations

import contextlib
import os
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from hypermap.cli.progress import counting
from hypermap.cli.simulate import errors_of, world_of
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.experiments.drives import Mapped, SimulatedDrive
    from hypermap.experiments.methods import Method
    from hypermap.experiments.results import WorldResult
    from hypermap.simulation import Errors, World


DRIVES = 5
"""In a series, unless the user says otherwise."""

_HAVE = {
    "--methods": ("thesis",),
    "--method": ("thesis", "ablation"),
    "--pcl": ("thesis",),
    "--parts": ("ablation",),
    "--network": ("thesis", "ablation"),
    "--drives": ("days",),
}
"""Which experiments have an option that not all have."""


@dataclass(frozen=True)
class Plan:
    """The options of `hypermap experiment`, as they are given.

    Attributes:
        name: of the experiment.
        worlds: words with commas between them.
        methods: beginnings of names with commas between them, or "all".
        added: further methods, by file or name.
        exact: whether the methods of the thesis find the regions of PCL exactly.
        parts: beginnings of names with commas between them, or "all", for `ablation`.
        seeds: how many.
        drives: in a series, for `days`.
        given_first_seed: None for that of the worlds.
        level: of errors.
        sensor: a preset's name.
        network: whether the network of the package detects the objects.
        rate: frames per second.
        given_jobs: drives at the same time; 0 for one per core.
    """

    name: str
    worlds: str
    methods: str
    added: tuple[str, ...]
    exact: bool
    parts: str
    seeds: int
    drives: int
    given_first_seed: int | None
    level: str
    sensor: str
    network: bool
    rate: float
    given_jobs: int

    def check_options(self) -> None:
        """Raise a HypermapError if an option is given that the experiment does not have."""
        given = {
            "--methods": self.methods != "all",
            "--method": bool(self.added),
            "--pcl": self.exact,
            "--parts": self.parts != "all",
            "--network": self.network,
            "--drives": self.drives != DRIVES,
        }
        for option, is_given in given.items():
            if is_given and self.name not in _HAVE[option]:
                raise HypermapError(f"{option}: the experiment `{self.name}` does not have it")

    @property
    def seed_range(self) -> range:
        """The seeds."""
        from hypermap.experiments.sets import first_seed_of, worlds_named

        first = self.given_first_seed
        if first is None:
            first = first_seed_of(worlds_named(self.worlds))
        return range(first, first + self.seeds)

    @property
    def jobs(self) -> int:
        """How many drives are mapped at the same time."""
        return self.given_jobs or len(os.sched_getaffinity(0))

    @cached_property
    def errors(self) -> Errors:
        """Those of camera, localization and detector."""
        return errors_of(self.level, self.sensor)

    @cached_property
    def described_worlds(self) -> list[World]:
        """The worlds; those for the network have its names.

        Raises:
            HypermapError: If there is no such world, one has no objects, or two have the same name.
        """
        from hypermap.experiments.sets import worlds_named
        from hypermap.simulation.network import named_for_network

        words = worlds_named(self.worlds)
        described = [world_of(word) for word in words]
        for world, word in zip(described, words, strict=True):
            if not world.objects:
                raise HypermapError(f"--worlds: {word} has no objects, so there is nothing to map")
        if self.network:
            described = [named_for_network(world) for world in described]
        _check_names([world.name for world in described], words)
        return described

    @property
    def command(self) -> str:
        """The command that repeats the experiment."""
        options = f"--worlds {shlex.quote(self.worlds)} --seeds {self.seeds}"
        options += f" --first-seed {self.seed_range.start} --errors {shlex.quote(self.level)}"
        if self.sensor != "kinect_v1":
            options += f" --sensor {self.sensor}"
        if self.network:
            options += " --network"
        if self.methods != "all":
            options += f" --methods {shlex.quote(self.methods)}"
        if self.exact:
            options += " --pcl"
        if self.parts != "all":
            options += f" --parts {shlex.quote(self.parts)}"
        if self.name == "days":
            options += f" --drives {self.drives}"
        options += "".join(f" --method {shlex.quote(word)}" for word in self.added)
        return f"hypermap experiment {self.name} {options} --rate {self.rate:g}"

    def map(self, methods: Mapping[str, Method]) -> list[WorldResult]:
        """Map all drives by all methods, and return the results, world by world.

        A method of a package that fails on a drive is not in the results; a note says why.

        Raises:
            HypermapError: If each method has failed.
        """
        from hypermap.experiments.drives import SimulatedDrive, map_drives
        from hypermap.experiments.results import WorldResult
        from hypermap.simulation import varied

        drives: list[SimulatedDrive] = [
            SimulatedDrive(varied(world, seed), seed, self.errors, self.rate, self.network)
            for world in self.described_worlds
            for seed in self.seed_range
        ]
        mapped: list[Mapped] = []
        failed: dict[str, str] = {}
        with (
            counting("mapping", len(drives), "drive") as count,
            contextlib.closing(map_drives(drives, methods, self.jobs)) as done,
        ):
            for each in done:
                for name in each.failed.keys() - failed.keys():
                    failed[name] = each.failed[name]
                    if len(failed) == len(methods):
                        raise HypermapError(failed[name])
                    note(f"{failed[name]}; its figures are left out")
                mapped.append(each)
                count()
        return [
            WorldResult.of([each for each in mapped if each.drive.world.name == world.name], failed)
            for world in self.described_worlds
        ]


def _check_names(names: list[str], words: list[str]) -> None:
    """Raise a HypermapError if two worlds have the same name."""
    first: dict[str, str] = {}
    for name, word in zip(names, words, strict=True):
        if name in first:
            raise HypermapError(
                f"--worlds: {first[name]} and {word} have the same name {name!r}; change the key "
                "`name` of one file, or use only one of them"
            )
        first[name] = word
