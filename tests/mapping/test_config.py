"""The settings of mapping: profiles, overrides from YAML, and their errors."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

from hypermap.core.errors import FileMissing, FormatError
from hypermap.formats.yaml_text import write_yaml
from hypermap.mapping.config import chosen_config, load_config, profile, to_dict
from hypermap.mapping.stages import EvidenceConfig, KeyframeConfig, OccupancyConfig


def write(folder: Path, text: str) -> Path:
    path = folder / "mapping.yaml"
    path.write_text(text)
    return path


def test_the_thesis_profile_has_the_figures_of_the_thesis() -> None:
    thesis = profile("thesis")
    evidence = thesis.evidence
    assert (evidence.association, evidence.min_jaccard, evidence.radius) == ("jaccard", 0.2, 0.5)
    assert (evidence.fusion, evidence.combine, evidence.loses) == ("best_shape", "matches", "all")
    assert (evidence.gain, evidence.loss, evidence.gain_by_score) == (1.0, 0.2, False)
    assert (evidence.max_existence, evidence.publish_above, evidence.forget_below) == (20, 2, -5)
    assert (evidence.margin, evidence.max_range) == (0, math.inf)
    assert thesis.perception.method == "organised"


def test_an_unknown_profile_is_an_error_that_names_the_known_ones() -> None:
    with pytest.raises(ValueError, match="no profile 'tesis'; did you mean 'thesis'"):
        profile("tesis")


def test_a_file_overrides_single_values(tmp_path: Path) -> None:
    path = write(tmp_path, "evidence: {loss: 1, fusion: convex_hull}\noccupancy:\n  hit: 0.9\n")
    config = load_config(path, profile("thesis"))
    assert (config.evidence.loss, config.evidence.fusion) == (1.0, "convex_hull")
    assert isinstance(config.evidence.loss, float)
    assert config.evidence.association == "jaccard"
    assert config.occupancy == dataclasses.replace(OccupancyConfig(), hit=0.9)


@pytest.mark.parametrize("text", ["", "# nothing\n", "evidence: {}\n"])
def test_a_file_without_values_changes_nothing(tmp_path: Path, text: str) -> None:
    assert load_config(write(tmp_path, text)) == profile("default")


def test_a_file_may_name_the_profile(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("profile: thesis\nevidence: {loss: 0.1}\n")
    thesis = profile("thesis")
    expected = dataclasses.replace(thesis, evidence=dataclasses.replace(thesis.evidence, loss=0.1))
    assert load_config(path) == expected
    assert chosen_config(None, path) == chosen_config("thesis", path) == expected
    assert load_config(path, thesis) == expected
    with pytest.raises(FormatError, match="profile: is another one than the base given"):
        load_config(path, profile("default"))
    assert chosen_config(None, path, has_network=True).perception.min_score == 0.3
    with pytest.raises(FormatError) as error:
        chosen_config("default", path)
    asked = "profile: is 'thesis', but 'default' is asked for; remove one of them"
    assert str(error.value) == f"{path}: {asked}"
    with pytest.raises(ValueError, match="there is no profile 'defualt'; did you mean 'default'"):
        chosen_config("defualt", path)
    path.write_text("profile: thesiss")
    with pytest.raises(FormatError) as error:
        chosen_config(None, path)
    assert str(error.value).startswith(f"{path}: profile: there is no profile 'thesiss'; did you")


@pytest.mark.parametrize("name", ["default", "thesis"])
def test_what_is_saved_with_a_map_is_read_again(tmp_path: Path, name: str) -> None:
    path = write(tmp_path, write_yaml(to_dict(profile(name))).decode())
    assert load_config(path) == profile(name)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("evidense: {}", "evidense: unknown key; did you mean 'evidence'?"),
        (
            "evidence: {los: 1}",
            "evidence.los: unknown key; did you mean 'loss'?",
        ),
        (
            "keyframes: {x: 1}",
            "keyframes.x: unknown key; known: min_distance, min_angle_deg, look_again",
        ),
        ("evidence: 3", "evidence: expected keys and values, found 3"),
        ("evidence:", "evidence: expected keys and values, found nothing"),
        ("- evidence", "expected keys and values, found a list"),
        ("evidence: {loss: much}", "evidence.loss: must be a number; found 'much'"),
        ("evidence: {loss: true}", "evidence.loss: must be a number; found True"),
        (
            "evidence: {class_depths: 0.5}",
            "evidence.class_depths: must be names with numbers; found 0.5",
        ),
        (
            "evidence: {class_depths: {rack: deep}}",
            "evidence.class_depths: rack must be a number; found 'deep'",
        ),
        (
            "evidence: {class_depths: {rack: -1}}",
            "evidence: class_depths: rack must be 0 to 20 m deep, got -1",
        ),
        ("evidence: {loss: .nan}", "evidence.loss: must be a number; found nan"),
        ("evidence: {loss: .inf}", "evidence: loss must be finite, got inf"),
        ("evidence: {loss: -1}", "evidence: loss must be at least 0, got -1"),
        (f"evidence: {{loss: 1{'0' * 400}}}", "evidence.loss: must be a number; found 1000"),
        (
            "evidence: {max_evidence: 2.5}",
            "evidence.max_evidence: must be a whole number; found 2.5",
        ),
        (
            "evidence: {max_evidence: 0}",
            "evidence: max_evidence must be at least 1 and at most 100000, got 0",
        ),
        (
            "evidence: {gain_by_score: 1}",
            "evidence.gain_by_score: must be true or false; found 1",
        ),
        (
            "evidence: {fusion: best}",
            "evidence.fusion: must be one of votes, best_shape, convex_hull; found 'best'",
        ),
        (
            "evidence: {forget_below: 3}",
            "evidence: forget_below, publish_above and max_existence must not decrease, "
            "got 3, 2, 20",
        ),
        (
            "occupancy: {max_height: 0}",
            "occupancy: min_height must be less than max_height, got 0.1 and 0",
        ),
        (
            "occupancy: {max_range: 1000}",
            "occupancy: max_range must be at least 0.05 and at most 50, got 1000",
        ),
        (
            "perception: {smoothness_deg: 91}",
            "perception: smoothness_deg must be between 0 and 90, got 91.0",
        ),
    ],
)
def test_what_does_not_fit_is_an_error_that_names_the_key(
    tmp_path: Path, text: str, message: str
) -> None:
    path = write(tmp_path, text)
    with pytest.raises(FormatError) as error:
        load_config(path)
    assert str(error.value).startswith(f"{path}: {message}")


@pytest.mark.parametrize("text", ["evidence: {", "evidence: !!python/name:os.system {}", "a: *b"])
def test_what_is_no_yaml_is_an_error_that_names_the_file(tmp_path: Path, text: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(FormatError) as error:
        load_config(path)
    assert str(error.value).startswith(str(path))


def test_a_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileMissing, match="there is no such configuration file"):
        load_config(tmp_path / "none.yaml")
    with pytest.raises(FileMissing, match="there is no such configuration file"):
        load_config(tmp_path)


def test_a_huge_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="larger than 1000000 bytes; is it a configuration"):
        load_config(write(tmp_path, "#" * 1_000_001))


@pytest.mark.parametrize(
    ("stage", "changes", "message"),
    [
        (EvidenceConfig, {"vote_share": 1.1}, "vote_share must be at least 0 and at most 1"),
        (EvidenceConfig, {"radius": math.nan}, "radius must be at least 0, got nan"),
        (KeyframeConfig, {"min_angle_deg": 181}, "min_angle_deg must be at least 0 and at most"),
        (OccupancyConfig, {"resolution": 0.0}, "resolution must be at least 0.001, got 0"),
        (OccupancyConfig, {"min_log_odds": 1.0}, "min_log_odds must be at most 0, got 1"),
    ],
)
def test_a_stage_checks_its_own_values(
    stage: type, changes: dict[str, float], message: str
) -> None:
    with pytest.raises(ValueError) as error:
        stage(**changes)
    assert str(error.value).startswith(message)
