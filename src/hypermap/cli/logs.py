"""Logging how a map is made, for Rerun and Foxglove: `--log` of `hypermap map`."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import check_output
from hypermap.cli.terminal import note

if TYPE_CHECKING:
    from hypermap.mapping.mapper import MappedFrame, Mapper

Log = Annotated[
    str | None,
    typer.Option(
        metavar="LOG",
        show_default=False,
        help="Also log images, detections, shapes and the growing map: a file ending with .rrd "
        "for Rerun or .mcap for Foxglove; or `rerun` or `foxglove`, to watch live.",
    ),
]


@contextmanager
def logging_to(
    target: str | None, recording: str, frame_id: str
) -> Iterator[Callable[[MappedFrame, Mapper], None] | None]:
    """Yield who is to watch the mapper, so that all is logged; None without a target.

    Args:
        target: see `open_log`.
        recording: name of what is mapped.
        frame_id: frame of the cameras' poses.

    Raises:
        HypermapError: If nothing can be logged there.
    """
    if target is None:
        yield None
        return
    from hypermap.viewer.logs.log import LoggedMapping, open_log

    if Path(target).suffix:
        check_output(Path(target), replace=True)
    with contextlib.closing(open_log(target, recording, frame_id)) as log:
        if target == "foxglove":
            note("open ws://127.0.0.1:8765 in Foxglove or Lichtblick (Foxglove WebSocket)")
        yield LoggedMapping(log)
    if Path(target).suffix:
        note(f"saved {target}")
