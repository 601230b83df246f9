"""A small recording to watch, and `hypermap map --view` of it as a process."""

from __future__ import annotations

import contextlib
import json
import queue
import re
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from .commands import PATIENCE, started

SIZE = (160, 120)
INTRINSICS = (131.25, 131.25, 79.5, 59.5)
CHAIR, CUP, GHOST = (58, 38, 102, 82), (16, 50, 40, 76), (120, 90, 150, 110)
EVIL = "<img src=x onerror=window.hacked=1>"
RED, BLUE, GRAY = (200, 40, 40), (40, 60, 200), (128, 128, 128)


def write_run(folder: Path, frames: int, cup_from: int) -> Path:
    """Write a TUM RGB-D folder of a camera that sways before a wall and sees things in front of it.

    A red chair is there from the first frame on, a blue cup from frame `cup_from` on. In every
    frame the wall is taken for something with an evil name, once.
    """
    folder.mkdir()
    depth = np.full((SIZE[1], SIZE[0]), 2.5)
    color = np.full((SIZE[1], SIZE[0], 3), GRAY, np.uint8)
    for number, (box, paint, lean) in enumerate([(CHAIR, RED, 0.2), (CUP, BLUE, 0.05)]):
        x0, y0, x1, y1 = np.add(box, (2, 2, -2, -2))
        depth[y0:y1, x0:x1] = np.linspace(1.5 + lean, 1.5 - lean, y1 - y0)[:, np.newaxis]
        color[y0:y1, x0:x1] = paint
        Image.fromarray((depth * 5000).astype(np.uint16)).save(folder / f"depth{number}.png")
        Image.fromarray(color).save(folder / f"color{number}.png")
    stamps = [f"{100 + 0.1 * i:.4f}" for i in range(frames)]
    has_cup = [i >= cup_from for i in range(frames)]
    for name, image in (("depth", "depth"), ("rgb", "color")):
        lines = (
            f"{stamp} {image}{int(cup)}.png\n" for stamp, cup in zip(stamps, has_cup, strict=True)
        )
        (folder / f"{name}.txt").write_text("".join(lines))
    poses = (f"{stamp} 0 {0.03 * (-1) ** i} 1 -0.5 0.5 -0.5 0.5" for i, stamp in enumerate(stamps))
    (folder / "groundtruth.txt").write_text("\n".join(poses) + "\n")
    chair = {"box": CHAIR, "name": "chair", "score": 0.9}
    ghost = {"box": GHOST, "name": EVIL, "score": 0.4}
    cup = {"box": CUP, "name": "cup", "score": 0.8}
    found = {
        stamp: [chair, ghost, *([cup] if shown else [])]
        for stamp, shown in zip(stamps, has_cup, strict=True)
    }
    text = json.dumps({"image_size": list(SIZE), "frames": found})
    (folder / "detections.json").write_text(text)
    return folder


class Watching:
    """A running `hypermap map --view`.

    Attributes:
        url: of the page.
        output: the map that is made.
    """

    def __init__(self, recording: Path, output: Path, *options: str) -> None:
        intrinsics = ["--intrinsics", ",".join(map(str, INTRINSICS))]
        shown = [*intrinsics, "--view", "--no-browser", *options]
        self.output = output
        self.process = started("map", recording, "-o", output, *shown, stderr=subprocess.STDOUT)
        self._lines: queue.Queue[str] = queue.Queue()
        self.said = ""
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        self.url = self.wait_for(r"http://127\.0\.0\.1:\d+/\S*")

    def _listen(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            for line in lines:
                self._lines.put(line)
        self._lines.put("")

    def wait_for(self, pattern: str) -> str:
        """Wait until something is said, and return it."""
        end = time.monotonic() + PATIENCE
        while not (found := re.search(pattern, self.said)):
            try:
                line = self._lines.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                raise AssertionError(f"{pattern!r} was not said:\n{self.said}") from None
            assert line, f"ended before {pattern!r} was said:\n{self.said}"
            self.said += line
        return found.group()

    def interrupt(self) -> None:
        """Press Ctrl-C."""
        self.process.send_signal(signal.SIGINT)

    def end(self) -> int:
        """Wait for the end, and return the exit code."""
        code = self.process.wait(timeout=PATIENCE)
        while line := self._lines.get(timeout=PATIENCE):
            self.said += line
        return code

    def kill(self) -> None:
        """End it whatever it does; if it can, it tidies up before."""
        self.process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=PATIENCE)
        self.process.kill()
        self.process.wait()
        self._listener.join(timeout=PATIENCE)


@contextlib.contextmanager
def watching(recording: Path, output: Path, *options: str) -> Iterator[Watching]:
    """Map a recording with --view, on any free port."""
    watched = Watching(recording, output, "--port", "0", *options)
    try:
        yield watched
    finally:
        watched.kill()
