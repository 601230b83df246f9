"""YAML as people write it in settings: bounded, whatever it contains."""

from __future__ import annotations

from typing import Any

_DEEPEST = 50


def parse_simple_yaml(text: str) -> Any:
    """Return the value of a YAML text without aliases that is not nested deeply.

    Aliases could let a small text stand for gigabytes, once somebody prints or walks its value.

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
                raise ValueError(
                    f"aliases such as *{event.anchor} are not allowed; write what they stand for"
                )
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEEPEST:
                raise ValueError(f"it is nested more than {_DEEPEST} deep")
        return yaml.load(text, loader)
    except (LookupError, AttributeError):  # PyYAML looks for what it expects
        raise ValueError("a tag, such as !!int, does not fit what it stands before") from None
    except (yaml.YAMLError, OverflowError) as error:
        raise ValueError(" ".join(str(error).split())) from None
