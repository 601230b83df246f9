"""Value layers as files: what is wrong with one is reported, and old readers keep them."""

from __future__ import annotations

import io

import numpy as np
import pytest

from hypermap.core.errors import FormatError
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.opaque import OpaqueLayer
from hypermap.core.samples import Samples
from hypermap.core.value_layer import ValueLayer
from hypermap.formats import hmap, open_map, save_map
from hypermap.formats.grid.value_files import PLUGIN
from hypermap.formats.store import MemoryStore
from hypermap.testing import occupancy_from_text

NAN = np.nan


def warmth() -> ValueLayer:
    return ValueLayer(
        "warmth",
        "map",
        GridGeometry(3, 2, 0.5),
        [[20, 22, 24], [20, NAN, 28]],
        "°C",
        samples=Samples.of([[0.2, 0.3]], [20.1]),
    )


def saved() -> dict[str, bytes]:
    store = MemoryStore()
    PLUGIN.save(warmth(), store, "warmth")
    return store.files


def npy(array, **options) -> bytes:
    content = io.BytesIO()
    np.save(content, array, **options)
    return content.getvalue()


def about(text: str) -> bytes:
    return f"{{origin: [0, 0, 0], resolution: 1, {text}}}".encode()


NO_NUMBERS = "m.hmap/warmth.npy: is not a .npy file of rows and columns of float32, as numpy.save"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("warmth.npy", None, "m.hmap/warmth.npy: there is no such file"),
        ("warmth.samples.npy", None, "m.hmap/warmth.samples.npy: there is no such file"),
        ("warmth.npy", npy(np.zeros((2, 3))), NO_NUMBERS),
        ("warmth.npy", npy(np.zeros(3, np.float32)), NO_NUMBERS),
        ("warmth.npy", npy(np.zeros((2, 3), np.float32, order="F")), NO_NUMBERS),
        ("warmth.npy", npy(np.array([[print]]), allow_pickle=True), NO_NUMBERS),
        ("warmth.npy", npy(np.zeros((2, 3), np.float32))[:-4],
         "m.hmap/warmth.npy: its 20 bytes are not 2 x 3 numbers"),
        ("warmth.npy", npy(np.zeros((2, 3), np.float32)).replace(b"(2, 3), }        ",
                                                                 b"(2, 399999999), }"),
         "m.hmap/warmth.npy: its 24 bytes are not 2 x 399999999 numbers"),
        ("warmth.npy", npy(np.zeros((0, 3), np.float32)),
         "m.hmap/warmth.yaml: a grid needs at least one cell"),
        ("warmth.npy", npy(np.full((2, 3), np.inf, np.float32)),
         "m.hmap/warmth.yaml: cells must be finite"),
        ("warmth.yaml", b"- 1", "m.hmap/warmth.yaml: expected keys and values"),
        ("warmth.yaml", b"origin: [0, 0, 0]", "m.hmap/warmth.yaml: resolution: "),
        ("warmth.yaml", about("unit: [C]"), "m.hmap/warmth.yaml: unit: "),
        ("warmth.yaml", about("decimals: 99"), "m.hmap/warmth.yaml: decimals: "),
        ("warmth.yaml", about("holds: [passwords]"), "m.hmap/warmth.yaml: holds[0]: "),
        ("warmth.yaml", about("made_by: {length: .inf}"), "m.hmap/warmth.yaml: made_by.length"),
        ("warmth.yaml", about("holds: [stamps]"),
         "m.hmap/warmth.stamps.npy: there is no such file"),
        ("warmth.samples.npy", npy(np.zeros((4, 3))),
         "m.hmap/warmth.samples.npy: has 3 columns, not 5"),
        ("warmth.samples.npy", npy(np.array([[0, 0, NAN, 0, 0]])),
         "m.hmap/warmth.samples.npy: values[0] is not finite"),
        ("warmth.samples.npy", npy(np.array([[0, 1e10, 1, 0, 0]])),
         "m.hmap/warmth.samples.npy: a sample is farther away than 1e+09 m"),
        ("warmth.samples.npy", npy(np.array([[0, 0, 1, 0.5, 0]])),
         "m.hmap/warmth.samples.npy: the column for censored values must be 0 or 1"),
    ],
)  # fmt: skip
def test_a_broken_file_gives_one_clear_error(name, content, message):
    files = {**saved(), name: content}
    store = MemoryStore({k: v for k, v in files.items() if v is not None}, "m.hmap")
    with pytest.raises(FormatError) as caught:
        PLUGIN.load(store, "warmth", "warmth", "map", {})
    assert str(caught.value).startswith(message)


def test_all_but_the_place_may_be_left_out():
    store = MemoryStore({"warmth.npy": saved()["warmth.npy"], "warmth.yaml": about("")})
    layer = PLUGIN.load(store, "warmth", "warmth", "map", {})
    assert layer.label_at([0.5, 0.5]).tolist() == ["20.0"]
    assert layer.samples is None


def test_a_program_that_does_not_know_the_layer_keeps_it(tmp_path, monkeypatch):
    save_map(Hypermap([occupancy_from_text("#."), warmth()]), tmp_path / "first.hmap")
    known = hmap.plugin_for
    with monkeypatch.context() as older:
        older.setattr(
            hmap, "plugin_for", lambda kind: None if kind == "ValueLayer" else known(kind)
        )
        opaque = open_map(tmp_path / "first.hmap")
        assert isinstance(opaque["warmth"], OpaqueLayer)
        save_map(opaque, tmp_path / "second.hmap")
    assert (tmp_path / "first.hmap").read_bytes() == (tmp_path / "second.hmap").read_bytes()
