"""What mapping and people leave in a map: its state and log of frames, pictures, notes, history."""

from __future__ import annotations

import dataclasses
import random
from pathlib import Path

from campaign.full_map import ATTACHED, full_map
from campaign.fuzz_targets.target import Target, draw_of, target_of_files
from campaign.mutation import Mutator, mutate_bytes, mutate_json, mutate_text
from campaign.questions import ask_everything
from hypermap import HypermapError, NotesLayer, open_map, save_map
from hypermap.formats.hmap import files_of_map, map_of_files


def mapper_state(_: Path) -> Target:
    """What mapping needs to go on with a map, and the log of frames in it."""
    return _target_of_member("mapper_state", _mutate_arrays)


def pictures(_: Path) -> Target:
    """The pictures of objects."""
    return _target_of_member("semantic.pictures", _mutate_arrays)


def embeddings(_: Path) -> Target:
    """What objects look like, as vectors."""
    return _target_of_member("semantic.embeddings", _mutate_arrays)


def history(_: Path) -> Target:
    """The history of a map, one version a line."""
    name = next(name for name in files_of_map(full_map()) if name.startswith("history."))
    return _target_of_member(name, _mutate_lines)


def _mutate_lines(data: bytes, draw: random.Random) -> bytes:
    """Spoil one line of JSON, or the text as a whole."""
    lines = data.split(b"\n")
    if draw.random() < 0.3:
        return mutate_text(data, draw)
    number = draw.randrange(len(lines))
    lines[number] = mutate_json(lines[number], draw)
    return b"\n".join(lines)


def _target_of_member(name: str, mutate: Mutator) -> Target:
    """Return a target of one file of a map, of which all is asked, and which is saved again."""
    members = files_of_map(full_map())

    def ask(data: bytes) -> None:
        hypermap = map_of_files({**members, name: data}, "a map")
        ask_everything(hypermap, draw_of(data))
        map_of_files(files_of_map(hypermap), "the same again")

    return Target(ask, [members[name]], mutate)


def notes(folder: Path) -> Target:
    """A map in a folder with notes, whose files are in it and next to it."""
    made = folder / "made"
    made.mkdir()
    hypermap = full_map()
    hypermap.remove("semantic")
    hypermap.mapper_state = hypermap.history = None
    layer = hypermap["notes"]
    assert isinstance(layer, NotesLayer)
    layer.inside_up_to = len(ATTACHED)  # so that the longer ones lie next to the map
    save_map(hypermap, made / "map.yaml")
    parts = {
        str(path.relative_to(made)): path.read_bytes()
        for path in sorted(made.rglob("*"))
        if path.is_file()
    }

    def read(place: Path, data: bytes) -> None:
        opened = open_map(place / "map.yaml")
        ask_everything(opened, draw_of(data))
        save_map(opened, place / "again.hmap")
        open_map(place / "again.hmap")

    return target_of_files(parts, read, folder)


def _mutate_arrays(data: bytes, draw: random.Random) -> bytes:
    """Spoil a file of arrays: what it says of them, their numbers, or a packed frame within."""
    head, mark, arrays = data.partition(b"\n")
    kind = draw.random()
    if kind < 0.4:
        return mutate_json(head, draw) + mark + arrays
    if kind < 0.5:
        return mutate_bytes(data, draw)
    if kind < 0.75 and b'"log.frames"' in head:
        return _with_a_frame_spoiled(data, draw)
    return head + mark + _with_numbers_spoiled(arrays, draw)


def _with_numbers_spoiled(arrays: bytes, draw: random.Random) -> bytes:
    """Change some bytes, so that the arrays keep their sizes."""
    spoiled = bytearray(arrays)
    for _ in range(draw.choice([1, 2, 8, 64]) if spoiled else 0):
        spoiled[draw.randrange(len(spoiled))] = draw.choice([0, 1, 0x7F, 0x80, 0xF0, 0xFF])
    return bytes(spoiled)


def _with_a_frame_spoiled(data: bytes, draw: random.Random) -> bytes:
    """Spoil a frame of the log, which is a packed file of arrays itself."""
    from hypermap.mapping.config import profile
    from hypermap.mapping.frame_log import LogPart
    from hypermap.mapping.mapper_state import dump_state, parse_state
    from hypermap.mapping.packed_frames import packed, unpacked

    try:
        state = parse_state(data, profile("default").evidence)
        part, *others = state.log
        number = draw.randrange(len(part.frames))
        plain, rest = unpacked(part.frames[number])
    except (HypermapError, ValueError, LookupError):
        return mutate_bytes(data, draw)
    frames = list(part.frames)
    frames[number] = packed(_mutate_arrays(plain, draw), rest)
    spoiled = LogPart(part.before, part.stamps, frames, part.poses)
    return dump_state(dataclasses.replace(state, log=[spoiled, *others]))
