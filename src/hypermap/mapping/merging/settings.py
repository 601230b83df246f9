"""Settings of two maps that are to be merged."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.mapping.config import MappingConfig, profile_like, to_dict
from hypermap.mapping.going_on import CannotGoOn, config_to_go_on_with
from hypermap.mapping.map_metadata import version_of_defaults

_ALWAYS_EQUAL = "min_score", "resolution"  # else, counts cannot be added, nor cells


class CannotMerge(HypermapError):
    """Two maps cannot be merged."""


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Name the map in errors about one that mapping cannot continue."""
    try:
        yield
    except CannotGoOn as error:
        raise CannotGoOn(f"{name}: {error}") from error


def common_config(
    first: Hypermap, second: Hypermap, names: tuple[str, str]
) -> tuple[MappingConfig, tuple[str, ...]]:
    """Return the configuration for two maps as one: that of the first.

    Whether pictures are kept, and whether poses are corrected by the map, may differ. Where another
    version began the second map, so may other settings, if one of the two values is the default of
    the profile of both: that version had another default.

    Args:
        first: a map.
        second: another one.
        names: of both, in messages.

    Returns:
        the configuration, and in which settings the second map differs, as text.

    Raises:
        CannotGoOn: If a map was not made by mapping, or lacks the mapper state.
        CannotMerge: If other settings differ.
    """
    with naming(names[0]):
        config = config_to_go_on_with(first)
    with naming(names[1]):
        theirs = config_to_go_on_with(second)
    alignment = replace(theirs.alignment, enabled=config.alignment.enabled)
    own = to_dict(config)
    other = to_dict(replace(theirs, pictures=config.pictures, alignment=alignment))
    defaults = to_dict(profile_like(own))
    versions = [version_of_defaults(one.metadata) for one in (first, second)]
    may_differ = versions[0] != versions[1] and defaults == to_dict(profile_like(other))
    differing = []
    for stage, values in own.items():
        for key, value in values.items():
            its = other[stage][key]
            if its == value:
                continue
            if not may_differ or key in _ALWAYS_EQUAL or defaults[stage][key] not in (value, its):
                raise CannotMerge(
                    f"the maps were made with different configurations ({stage}: {key}: {value} "
                    f"and {its}); map one of the recordings again with that of the other (--config)"
                )
            differing.append(f"{stage}: {key}: {value} instead of {its}")
    return config, tuple(differing)
