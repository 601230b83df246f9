"""How objects are found and mapped: the options that `hypermap map` and `hypermap live` share."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer


class ProfileName(str, enum.Enum):
    """The named configurations."""

    default = "default"
    thesis = "thesis"


Objects = Annotated[
    bool, typer.Option("--objects/--no-objects", help="Map objects, or only the occupancy layer.")
]
Detector = Annotated[
    str | None,
    typer.Option(
        metavar="MODEL",
        help="Detect objects with this neural network: .onnx, or a name from `hypermap detectors`.",
    ),
]
Labels = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", readable=False, help="Class names, if the network does not contain them."
    ),
]
Score = Annotated[
    float | None,
    typer.Option(min=0, max=1, show_default="0.3", help="Minimum score of detections."),
]
Detections = Annotated[
    Path | None,
    typer.Option(metavar="FILE", readable=False, help="Read detections from this JSON file."),
]
Profile = Annotated[
    ProfileName | None,
    typer.Option(
        show_default="default", help="thesis: the method of 2019. default: the best we have."
    ),
]
Onto = Annotated[
    Path | None,
    typer.Option(
        metavar="MAP",
        readable=False,
        help="Add to this map: continue where `map` or `live` stopped. Frames that it already "
        "contains do not count twice.",
    ),
]
Config = Annotated[
    Path | None,
    typer.Option(metavar="FILE", readable=False, help="YAML file that overrides settings."),
]
