"""Every notebook runs from top to bottom, and shows pictures; what it shows is not kept in it."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "notebooks").glob("*.ipynb"))


# What a notebook before has left: names, its folder, and which warnings have been said already.
AFRESH = """
import os, warnings
os.chdir({folder!r})
warnings.simplefilter("default", append=True)
%reset -f
"""

pytestmark = pytest.mark.xdist_group("notebooks")  # they share a kernel


@pytest.fixture(scope="module")
def nbformat() -> Any:
    """The module, which takes long to import."""
    return pytest.importorskip("nbformat", reason="nbformat is not installed (make docs)")


@pytest.fixture(scope="module")
def client(nbformat: Any) -> Iterator[Any]:
    """Runs notebooks in one kernel: to start one and to import Hypermap takes two seconds."""
    pytest.importorskip("ipykernel", reason="ipykernel is not installed (make docs)")
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed (make docs)")
    client = nbclient.NotebookClient(nbformat.v4.new_notebook(), timeout=480, kernel_name="python3")
    with client.setup_kernel():
        yield client


@pytest.fixture
def run(client: Any, nbformat: Any, tmp_path: Path) -> Callable[[Any], None]:
    """Return a function that runs a notebook in a folder of the test, as if it were the first."""

    def run(notebook: Any) -> None:
        afresh = nbformat.v4.new_code_cell(AFRESH.format(folder=str(tmp_path)))
        for each in (nbformat.v4.new_notebook(cells=[afresh]), notebook):
            client.nb = each
            client.execute(cleanup_kc=False)

    return run


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_pictures(
    path: Path, nbformat: Any, run: Callable[[Any], None]
) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    run(notebook)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert any(output.get("name") == "stdout" for output in outputs)
    warned = [output.text for output in outputs if output.get("name") == "stderr"]
    assert not any("Warning" in text for text in warned), warned


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_what_it_shows(path: Path) -> None:
    cells = [cell for cell in json.loads(path.read_text("utf-8"))["cells"] if "outputs" in cell]
    assert cells
    assert not any(cell["outputs"] or cell["execution_count"] for cell in cells)


def test_the_notebooks_kernel_is_this_python(nbformat: Any, run: Callable[[Any], None]) -> None:
    cell = nbformat.v4.new_code_cell("import sys; print(sys.executable)")
    run(nbformat.v4.new_notebook(cells=[cell]))
    assert cell.outputs[0].text.strip() == sys.executable


def test_no_notebook_finds_what_another_has_left(
    nbformat: Any, run: Callable[[Any], None], tmp_path: Path
) -> None:
    left = 'import os, warnings; warnings.warn("again"); os.chdir("/")'
    cells = [nbformat.v4.new_code_cell(source) for source in (left, left, "print(os.getcwd())")]
    for cell in cells[:2]:
        run(nbformat.v4.new_notebook(cells=[cell]))
        assert "UserWarning: again" in cell.outputs[0].text
    with pytest.raises(Exception, match="name 'os' is not defined"):
        run(nbformat.v4.new_notebook(cells=[cells[2]]))
    cells[2].source = "import os; print(os.getcwd())"
    run(nbformat.v4.new_notebook(cells=[cells[2]]))
    assert cells[2].outputs[0].text.strip() == str(tmp_path)
