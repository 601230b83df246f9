from __future__ import annotations

import io
import queue

from rich.console import Console

from hypermap.cli import progress
from hypermap.mapping.counts import Counts
from hypermap.mapping.recording_to_map import Progress


def test_a_terminal_shows_a_bar_with_rate_objects_and_time_left(monkeypatch):
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=120)
    monkeypatch.setattr(progress, "err", lambda: console)
    with progress.mapping_progress(40) as report:
        report(Progress(done=10, total=40, objects=3, counts=Counts(used=10)))
    text = screen.getvalue()
    for words in ("mapping", "10/40", "/s, 3 objects", "left"):
        assert words in text


def test_elsewhere_a_plain_line_comes_now_and_then(capsys):
    with progress.mapping_progress(40) as report:
        for done in range(1, 41):
            report(Progress(done=done, total=40, objects=3, counts=Counts(used=done)))
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("mapping: 1 of 40 frames, ")
    assert "3 objects" in line


def test_one_of_a_thing_is_told_in_the_singular(monkeypatch, capsys):
    with progress.counting("mapping", 1, "drive"):
        pass
    with progress.counting("mapping", 2, "series of drives", "series of drives"):
        pass
    said = capsys.readouterr().err.splitlines()
    assert said == ["mapping: 1 drive ...", "mapping: 2 series of drives ..."]
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=120)
    monkeypatch.setattr(progress, "err", lambda: console)
    with progress.counting("reading", 1, "map") as count:
        count()
    with progress.mapping_progress(1) as report:
        report(Progress(done=1, total=1, objects=1, counts=Counts(used=1)))
    assert "map," in screen.getvalue()
    assert "frame, 0.0/s, 1 object," in screen.getvalue()


def test_a_work_of_unknown_length_says_that_it_goes_on(monkeypatch, capsys):
    with progress.working("aligning b.hmap"):  # which takes no time, so nothing is said
        pass
    assert capsys.readouterr().err == ""
    said: queue.Queue[str] = queue.Queue()
    monkeypatch.setattr(progress, "_EVERY", 0.0)
    monkeypatch.setattr(progress, "note", said.put)
    with progress.working("aligning b.hmap"):
        assert said.get(timeout=10) == "aligning b.hmap ..."
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=120)
    monkeypatch.setattr(progress, "err", lambda: console)
    with progress.working("aligning [b].hmap"):
        pass
    assert "aligning [b].hmap" in screen.getvalue()
    assert "0:00:00" in screen.getvalue()


def test_a_pace_leaves_out_the_first_frame_which_loads_code(monkeypatch):
    clock = iter([10.0, 10.5, 12.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    pace = progress.Pace()
    assert [pace.after(done) for done in (1, 2, 5)] == [0.0, 2.0, 2.0]
