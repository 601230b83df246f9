"""YAML as people write it in settings: bounded, whatever it contains."""

from __future__ import annotations

from typing import Any

_DEEPEST = 50


def parse_simple_yaml(text: str) -> Any:
    """Return the value of a YAML text without aliases and tags that is not nested deeply.

    Aliases could let a small text stand for gigabytes, once somebody prints or walks its value.
    At a tag that does not fit its text, PyYAML raises whatever comes.

    Raises:
        ValueError: If it is anything else, in one line.

    >>> parse_simple_yaml("kitchen: {oven: 3, sink: 1.5}")
    {'kitchen': {'oven': 3, 'sink': 1.5}}
    """
    import yaml

    loader: type[Any] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        depth = 0
        for event in yaml.parse(text, loader):
            if isinstance(event, yaml.AliasEvent):
                raise ValueError(f"aliases such as *{event.anchor} are not allowed")
            if tag := getattr(event, "tag", None):
                raise ValueError(f"tags such as {tag} are not allowed")
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEEPEST:
                raise ValueError(f"it is nested more than {_DEEPEST} deep")
        return yaml.load(text, loader)
    except (yaml.YAMLError, OverflowError) as error:
        raise ValueError(" ".join(str(error).split())) from None
