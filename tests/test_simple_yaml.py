from __future__ import annotations

from pathlib import Path

import pytest

from hypermap import HypermapError
from hypermap.cli.node_options import parse_params
from hypermap.fleet.batch.jobs import _choices
from hypermap.perception.detectors.labels import read_labels
from hypermap.questions.taxonomy import load_taxonomy
from hypermap.rooms.kinds import load_kinds
from hypermap.simple_yaml import parse_simple_yaml

HOSTILE = {
    "an alias": "k: {a: &a [1, 1], b: [*a, *a]}",
    "itself": "&a [*a]",
    "deep": "[" * 3000 + "]" * 3000,
    "a long number": "k: {a: " + "9" * 5000 + "}",
    "no date": "k: {a: 2020-99-99}",
    "a long time": "k: {a: 1" + ":59" * 300 + ".5}",
    "no number": "k: {a: !!int ''}",
    "no word for yes": "k: {a: !!bool kitchen}",
    "code": "!!python/object/apply:os.system [id]",
}
hostile = pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)


@hostile
def test_hostile_texts_are_refused_in_one_line(text: str) -> None:
    with pytest.raises(ValueError) as refused:
        parse_simple_yaml(text)
    assert "\n" not in str(refused.value)


def test_a_tag_that_fits_is_read() -> None:
    assert parse_simple_yaml("k: !!str 5") == {"k": "5"}


@hostile
@pytest.mark.parametrize("read", [load_kinds, load_taxonomy, read_labels])
def test_files_of_settings_name_the_file(text: str, read: object, tmp_path: Path) -> None:
    file = tmp_path / "settings.yaml"
    file.write_text(text)
    with pytest.raises(HypermapError, match=r"settings\.yaml"):
        read(file)  # type: ignore[operator]


@hostile
def test_options_stay_texts_or_are_refused(text: str) -> None:
    with pytest.raises(HypermapError, match="--set"):
        _choices(f"evidence.loss={text}")
    assert parse_params([f"label={text}"])["label"] == text
