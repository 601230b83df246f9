"""Tables of results, as CSV, LaTeX and HTML."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import pytest

from hypermap.experiments.tables import (
    Column,
    Interval,
    Table,
    csv_of,
    html_of,
    latex_of,
    save_tables,
    text_of,
)

TABLE = Table(
    "lab-methods",
    "R&D_lab: 50 % of <all>",
    (
        Column("method"),
        Column("IoU", style="bar"),
        Column("gain"),
        Column("p", style="probability"),
    ),
    (
        ("best & worst", 1 / 3, Interval(-0.126, -0.2, 0.05), 0.00004),
        ("default", 0.9, None, None),
    ),
    ("default",),
)


def test_intervals_of_figures_have_no_signs_and_those_of_one_value_are_not_written() -> None:
    column = Column("IoU")
    assert text_of(Interval(0.78, 0.7, 0.86, is_change=False), column) == "0.78 (0.70 to 0.86)"
    assert text_of(Interval(0.2, 0.2, 0.2), column) == "+0.20"


def test_csv_has_all_digits_and_three_columns_for_an_interval() -> None:
    head, first, second = csv.reader(io.StringIO(csv_of(TABLE)))
    assert head == ["method", "IoU", "gain", "gain: low", "gain: high", "p"]
    assert first[0] == "best & worst"
    assert [float(cell) for cell in first[1:]] == [1 / 3, -0.126, -0.2, 0.05, 0.00004]
    assert second == ["default", "0.9", "", "", "", ""]


def test_latex_escapes_names_and_writes_minus_signs() -> None:
    lines = latex_of(TABLE).splitlines()
    assert r"\caption{R\&D\_lab: 50 \% of \textless{}all\textgreater{}}" in lines
    assert r"\begin{tabular}{lrrr}" in lines
    assert r"best \& worst & 0.33 & $-$0.13 ($-$0.20 to +0.05) & 4e-05 \\" in lines
    assert r"\textbf{default} & \textbf{0.90} & \textbf{--} & \textbf{--} \\" in lines
    assert [line for line in lines if "rule" in line] == [r"\toprule", r"\midrule", r"\bottomrule"]


def test_html_escapes_names_and_has_bars() -> None:
    page = html_of(TABLE)
    assert "<caption>R&amp;D_lab: 50 % of &lt;all&gt;</caption>" in page
    assert '<span class=bar style="width:2.00em"></span>0.33' in page
    assert "<tr class=ours><td>default</td>" in page


def test_some_columns_of_a_table_are_a_table() -> None:
    assert TABLE.only("method", "p").rows == (("best & worst", 0.00004), ("default", None))


def test_each_table_is_saved_as_csv_and_latex(tmp_path: Path) -> None:
    folder = tmp_path / "tables"
    save_tables([TABLE], folder)
    save_tables([TABLE], folder)  # which is there now
    assert (folder / "lab-methods.csv").read_text() == csv_of(TABLE)
    assert (folder / "lab-methods.tex").read_text() == latex_of(TABLE)


def test_tables_of_other_worlds_do_not_stay_next_to_new_ones(tmp_path: Path) -> None:
    save_tables([TABLE, replace(TABLE, name="floor")], tmp_path)
    for name in ("own.csv", "own.tex", "floor-notes.csv"):
        (tmp_path / name).write_text(latex_of(TABLE))  # labeled as another file
    (tmp_path / "folder.tex").mkdir()
    save_tables([TABLE], tmp_path)
    kept = [
        "floor-notes.csv",
        "folder.tex",
        "lab-methods.csv",
        "lab-methods.tex",
        "own.csv",
        "own.tex",
    ]
    assert sorted(file.name for file in tmp_path.iterdir()) == kept


def test_no_name_is_an_argument_of_a_command_in_latex() -> None:
    lines = latex_of(Table("t", "t", (Column("c"),), (("[x]",), ("*",)))).splitlines()
    assert [line for line in lines if line.endswith(r"\\")] == [
        r"c \\",
        r"{[}x] \\",
        r"{*} \\",
    ]


def test_tables_of_any_name_are_saved_each_as_its_own(tmp_path: Path) -> None:
    names = ("a/b: 1%", "a b 1", "../x\udcff", "A-b-1")
    save_tables([replace(TABLE, name=name) for name in names], tmp_path / "tables")
    files = sorted(file.name for file in tmp_path.rglob("*.tex"))
    assert files == ["..-x.tex", "A-b-1-3.tex", "a-b-1-2.tex", "a-b-1.tex"]
    assert r"\label{tab:a-b-1-2}" in (tmp_path / "tables" / "a-b-1-2.tex").read_text()


@pytest.mark.parametrize("sign", ["\\", "~", "^", "{", "#", "$", "<", "|", "\n\n"])
def test_no_sign_means_anything_in_latex(sign: str) -> None:
    table = Table("t", f"a{sign}b", (Column("c"),), ())
    (caption,) = (line for line in latex_of(table).splitlines() if "caption" in line)
    assert caption != rf"\caption{{a{sign}b}}"
