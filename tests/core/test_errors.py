from __future__ import annotations

import pickle

import pytest

from hypermap.core.errors import (
    FileMissing,
    FormatError,
    FrameError,
    HypermapError,
    LayerNotFound,
    MissingExtra,
    ObjectNotFound,
)


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (FormatError("is wrong"), "is wrong"),
        (FormatError("is wrong", path="a.hmap"), "a.hmap: is wrong"),
        (FormatError("is wrong", key="layers[0]"), "layers[0]: is wrong"),
        (FormatError("is wrong", path="a.hmap", key="file"), "a.hmap: file: is wrong"),
        (LayerNotFound("semantik", ["semantic"]), "there is no layer 'semantik'; did you mean "
         "'semantic'?"),
        (LayerNotFound("rooms", []), "there is no layer 'rooms'; known: none"),
        (ObjectNotFound("layer 's' has no object with id 3"), "layer 's' has no object with id 3"),
        (MissingExtra("GeoPandas export", "geo"), "GeoPandas export needs an optional library: "
         "pip install 'hypermap[geo]'"),
    ],
)  # fmt: skip
def test_messages_name_the_place_and_the_remedy(error: HypermapError, message: str) -> None:
    assert str(error) == message


def test_what_is_wrong_in_which_file_can_be_asked_for() -> None:
    error = FormatError("is wrong", path="a.hmap", key="file")
    assert (error.path, error.key) == ("a.hmap", "file")
    assert (FormatError("is wrong").path, FormatError("is wrong").key) == (None, None)


@pytest.mark.parametrize(
    ("error", "builtin"),
    [
        (FileMissing("x"), FileNotFoundError),
        (LayerNotFound("x", []), KeyError),
        (ObjectNotFound("x"), KeyError),
        (MissingExtra("x", "y"), ImportError),
        (FrameError("x"), HypermapError),
    ],
)
def test_errors_are_caught_as_the_builtin_ones_too(
    error: HypermapError, builtin: type[Exception]
) -> None:
    assert isinstance(error, builtin)
    assert isinstance(error, HypermapError)


@pytest.mark.parametrize(
    "error",
    [
        FormatError("is wrong", path="a.hmap", key="file"),
        LayerNotFound("semantik", ["semantic"]),
        ObjectNotFound("layer 's' has no object with id 3"),
        MissingExtra("GeoPandas export", "geo"),
        FileMissing("x"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_travels_from_one_process_to_another(error: HypermapError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)
