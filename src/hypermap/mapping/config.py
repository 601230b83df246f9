"""How a map is made: the settings of all stages, and the profiles that name them.

`load_config` applies a YAML file to a profile, and each map saves the settings that made it
(`to_dict`). The defaults are in `hypermap.mapping.stages`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hypermap.core.errors import FormatError, did_you_mean
from hypermap.mapping.overrides import override, read_overrides
from hypermap.mapping.stages import (
    AlignmentConfig,
    EvidenceConfig,
    KeyframeConfig,
    OccupancyConfig,
    PictureConfig,
)
from hypermap.perception.config import PerceptionConfig

_LEAST_SCORE = 0.3  # of a network's detections; profiles accept all recorded ones


@dataclass(frozen=True)
class MappingConfig:
    """All settings of mapping, one attribute per stage.

    >>> profile("thesis").evidence.association
    'jaccard'
    """

    perception: PerceptionConfig = field(default_factory=PerceptionConfig)
    evidence: EvidenceConfig = field(default_factory=EvidenceConfig)
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    keyframes: KeyframeConfig = field(default_factory=KeyframeConfig)
    alignment: AlignmentConfig = field(default_factory=AlignmentConfig)
    pictures: PictureConfig = field(default_factory=PictureConfig)


def profile(name: str) -> MappingConfig:
    """Return a named configuration.

    "thesis" is the method of 2019, with region growing in the image: nearly the same result as
    PCL's, in a hundredth of the time (`method: unorganised` follows PCL exactly). "default" is the
    best method that we know.

    Raises:
        ValueError: If there is no such profile.
    """
    if name not in _PROFILES:
        raise ValueError(f"there is no profile {name!r}; {did_you_mean(name, _PROFILES)}")
    return _PROFILES[name]


def profile_like(values: Mapping[str, Any]) -> MappingConfig:
    """Return the profile that has the most of some values, such as those saved in a map.

    Args:
        values: by stage and key, as from `to_dict`; of an earlier version, some are missing.
    """

    def shared(config: MappingConfig) -> int:
        own = to_dict(config)
        return sum(
            key in own.get(stage, ()) and own[stage][key] == value
            for stage, found in values.items()
            if isinstance(found, Mapping)
            for key, value in found.items()
        )

    return max(_PROFILES.values(), key=shared)


def load_config(path: str | Path, base: MappingConfig | None = None) -> MappingConfig:
    """Return a configuration with the values that a YAML file overrides.

    Args:
        path: a YAML file of stages and their keys, such as `evidence: {loss: 0.1}`.
        base: where all other values come from; if None, the profile that the file names in its
            key `profile`, or else "default".

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it is not YAML, a key is unknown, a value has the wrong type or range, or
            the file names another profile than `base`.
    """
    file = Path(path)
    values = dict(read_overrides(file))
    if base is None or "profile" in values:
        named = _profile_for(None, values, file)
        if base not in (None, named):
            raise FormatError("is another one than the base given", path=file, key="profile")
        base = named
    return override(base, values, path=file)


def chosen_config(
    name: str | None = None,
    path: str | Path | None = None,
    score: float | None = None,
    has_network: bool = False,
) -> MappingConfig:
    """Return the configuration that a user asks for.

    Args:
        name: the profile; None takes that of the file, or else "default".
        path: a YAML file with values that differ (see `load_config`).
        score: detections below it are dropped; None takes the value of the file or the profile.
        has_network: whether the detections come from a network. Then
            the threshold is at least 0.3, unless the file or `score` sets another one.

    Raises:
        ValueError: If there is no such profile, or the score is out of range.
        HypermapError: As `load_config` does.
    """
    file = None if path is None else Path(path)
    values = {} if file is None else dict(read_overrides(file))
    config = _profile_for(name, values, file)
    if has_network:
        config = _with_score(config, max(config.perception.min_score, _LEAST_SCORE))
    config = override(config, values, path=file)
    return config if score is None else _with_score(config, score)


def _profile_for(name: str | None, values: dict[str, Any], file: Path | None) -> MappingConfig:
    """Return the profile of a name, or that which a file's values name, and take its name out."""
    named = values.pop("profile", None)
    asked = profile(name or "default")
    if named is None:
        return asked
    if name not in (None, named):
        problem = f"is {str(named)!r}, but {name!r} is asked for; remove one of them"
        raise FormatError(problem, path=file, key="profile")
    try:
        return profile(str(named))
    except ValueError as error:
        raise FormatError(str(error), path=file, key="profile") from None


def _with_score(config: MappingConfig, score: float) -> MappingConfig:
    perception = dataclasses.replace(config.perception, min_score=score)
    return dataclasses.replace(config, perception=perception)


def to_dict(config: MappingConfig) -> dict[str, Any]:
    """Return the configuration as plain values, in the form that `load_config` reads."""
    return {stage: dict(values) for stage, values in dataclasses.asdict(config).items()}


_PROFILES: Mapping[str, MappingConfig] = {
    "default": MappingConfig(),
    "thesis": MappingConfig(
        perception=PerceptionConfig.thesis(),
        evidence=EvidenceConfig(
            class_sizes="any",
            association="jaccard",
            combine="matches",
            fusion="best_shape",
            landmarks=False,
            completion="none",
            renewal=0.0,
            gain=1.0,
            gain_by_score=False,
            loss=0.2,
            detection_rate="fixed",
            loses="all",
            sight="area",
            margin=0.0,
            max_range=math.inf,
            contested=0.0,
            slip=1.0,
            slack=0.0,
            abstain="outside",
            half_weight=math.inf,
            align=0.0,
            exclusive=False,
            max_growth=math.inf,
            confidence="score",
            min_probability=0.0,
            moves=False,
        ),
        keyframes=KeyframeConfig(min_distance=0.02, min_angle_deg=1.0, look_again=0.0),
        alignment=AlignmentConfig(enabled=False),
    ),
}
