"""The JSON Schema of a query (JSON Schema 2020-12)."""

from __future__ import annotations

from typing import Any, get_args

from hypermap.questions.query import MOST_LETTERS, Give, Measure, Per, Query, Relation, Seen, Which

_NAMES = {"type": "array", "items": {"type": "string", "minLength": 1}}
_MOMENT = {"type": "string", "description": "ISO 8601, as 2026-11-20T10:00+01:00; else in UTC"}
_CONDITIONS = {"type": "array", "items": {"$ref": "#/$defs/condition"}}

QUERY_SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "A question about a hypermap",
    "$ref": "#/$defs/query",
    "$defs": {
        "query": {
            "type": "object",
            "additionalProperties": False,
            "properties": {
                "give": {"enum": list(get_args(Give)), "default": "objects"},
                "names": {**_NAMES, "description": "of objects, any of which matches"},
                "exact": {
                    "type": "boolean",
                    "default": False,
                    "description": "names as in the map, without synonyms and kinds",
                },
                "besides": {**_NAMES, "description": "that the objects must not have"},
                "ids": {"type": "array", "items": {"type": "integer"}},
                "tags": {**_NAMES, "description": "all of which the objects have"},
                "like": {
                    "type": "string",
                    "minLength": 1,
                    "maxLength": MOST_LETTERS,
                    "description": "what the objects look like; instead of which",
                },
                "rooms": {**_NAMES, "description": "or kinds of rooms, if these are asked for"},
                "where": {**_CONDITIONS, "description": "conditions that the objects meet"},
                "when": {
                    "description": "one time, or several that all hold",
                    "anyOf": [
                        {"$ref": "#/$defs/when"},
                        {"type": "array", "items": {"$ref": "#/$defs/when"}},
                    ],
                },
                "as_of": {**_MOMENT, "description": "the map of this time is asked"},
                "measured": {"$ref": "#/$defs/measured"},
                "layers": {**_NAMES, "description": "that are asked; none for all"},
                "value": {"type": "number", "description": "of cells, for labels"},
                "which": {"enum": list(get_args(Which))},
                "count": {"type": "integer", "minimum": 1},
                "rank": {
                    "type": "integer",
                    "minimum": 1,
                    "description": "2 for the second nearest, largest ... alone; without count",
                },
                "start": {
                    "$ref": "#/$defs/reference",
                    "description": "from where distances are measured",
                },
                "by": {"enum": list(get_args(Measure)), "default": "air"},
                "per": {
                    "enum": list(get_args(Per)),
                    "description": "counts the objects of each room, for count, exists and rooms",
                },
                "number": {"$ref": "#/$defs/number"},
            },
        },
        "when": {
            "type": "object",
            "additionalProperties": False,
            "description": "when the objects were seen, or not seen since",
            "properties": {
                "seen": {"enum": list(get_args(Seen)), "default": "seen"},
                "since": _MOMENT,
                "until": _MOMENT,
            },
            "anyOf": [{"required": ["since"]}, {"required": ["until"]}],
        },
        "number": {
            "type": "object",
            "additionalProperties": False,
            "minProperties": 1,
            "description": "how many objects there are, for exists; with per, in a room",
            "properties": {
                "at_least": {"type": "integer", "minimum": 0},
                "at_most": {"type": "integer", "minimum": 0},
            },
        },
        "measured": {
            "type": "object",
            "additionalProperties": False,
            "description": "values around the objects, or at the places",
            "properties": {
                "layer": {"type": "string", "minLength": 1},
                "above": {"type": "number"},
                "below": {"type": "number"},
            },
        },
        "condition": {
            "type": "object",
            "additionalProperties": False,
            "required": ["relation", "what"],
            "properties": {
                "relation": {"enum": list(get_args(Relation))},
                "what": {"$ref": "#/$defs/reference"},
                "within": {"type": "number", "minimum": 0, "description": "meters"},
                "negated": {"type": "boolean", "default": False},
                "and": {
                    "$ref": "#/$defs/reference",
                    "description": "the other place, for between and nothing else",
                },
            },
        },
        "reference": {
            "type": "object",
            "additionalProperties": False,
            "description": "exactly one of names, rooms, point, area and asker",
            "properties": {
                "names": {**_NAMES, "minItems": 1},
                "where": _CONDITIONS,
                "rooms": {**_NAMES, "minItems": 1},
                "point": {
                    "type": "array",
                    "items": {"type": "number"},
                    "minItems": 2,
                    "maxItems": 2,
                    "description": "x and y in the base frame [m]",
                },
                "area": {"type": "string", "description": "in the base frame [m], as WKT"},
                "asker": {"const": True},
            },
            "oneOf": [{"required": [key]} for key in ("names", "rooms", "point", "area", "asker")],
        },
    },
}

# Fields of a query that are plain numbers, texts or flags need no line above.
_PLAIN: dict[str, dict[str, Any]] = {
    "bool": {"type": "boolean", "default": False},
    "float | None": {"type": "number"},
    "int | None": {"type": "integer"},
    "str | None": {"type": "string", "minLength": 1},
}
for _name, _spec in Query.__dataclass_fields__.items():
    if _spec.type in _PLAIN:
        QUERY_SCHEMA["$defs"]["query"]["properties"].setdefault(_name, _PLAIN[_spec.type])
