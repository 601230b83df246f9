"""What `auto` says of a recording: measured in a pass over its frames before the others."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import islice
from pathlib import Path

from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError
from hypermap.core.trajectory import compose
from hypermap.mapping.preflight import clock_offset, leveling_pose, option_text
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.recording import OnBadFrame
from hypermap.recordings import RecordingOptions, open_recording

SPREAD = 40  # frames all over a recording, by which the floor is found
IN_A_ROW = 300  # frames by which clocks are compared


def measured_options(
    path: Path, options: RecordingOptions, measured: Collection[str]
) -> RecordingOptions:
    """Return options with the time offset and the level that the frames show, and say them.

    Args:
        path: the recording.
        options: what was given.
        measured: "time_offset", "level" or both.

    Raises:
        HypermapError: If the recording cannot be read.
    """
    if "time_offset" in measured:
        offset = clock_offset(islice(usable_frames(path, options), IN_A_ROW))
        if offset is None:
            note("time offset: unknown, as frames are too far apart or the motion is too uniform")
        else:
            note(f"time offset: {offset:.2f} s")
            options = replace(options, time_offset=offset)
    if "level" in measured:
        options = _leveled(path, options)
    return options


def usable_frames(
    path: Path,
    options: RecordingOptions,
    most: int = 0,
    on_bad: OnBadFrame = lambda _stamp, _error: None,
) -> Iterator[RgbdFrame]:
    """Yield the frames of a recording that can be mapped; what is noted of it is not logged.

    Args:
        path: where it is.
        options: how it is read.
        most: about as many, spread over the whole recording; 0 for all.
        on_bad: called for each frame that cannot be mapped.
    """
    from hypermap.mapping.usable import why_unusable

    if most:
        count = len(open_recording(path, options))
        options = replace(options, every=options.every * max(1, count // most))
    with _silenced("hypermap.recordings"):  # `info` prints the notes, and mapping logs them
        for frame in open_recording(path, options).frames(on_bad):
            reason = why_unusable(frame)
            if reason is None:
                yield frame
            else:
                on_bad(frame.stamp, HypermapError(reason))


@contextmanager
def _silenced(name: str) -> Iterator[None]:
    """Log nothing below an error under this name."""
    log = logging.getLogger(name)
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)


def _leveled(path: Path, options: RecordingOptions) -> RecordingOptions:
    pose, floor = leveling_pose(usable_frames(path, options, SPREAD))
    if floor is None:
        note("level: no floor is visible, so the world is unchanged")
        return options
    if (pose == compose()).all():
        note(f"level: within {floor.tilt_deg:.1f} degrees, so the world is unchanged")
        return options
    pose = compose(pose, options.world_pose())
    note(
        f"level: the floor is tilted by {floor.tilt_deg:.1f} degrees and lies at "
        f"{floor.offset:.2f} m; the world is moved by --world-transform={option_text(pose, floor)}"
    )
    return replace(options, map_T_world=tuple(pose.ravel().tolist()))
