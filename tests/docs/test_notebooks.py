"""Every notebook runs from top to bottom, and shows pictures; what it shows is not kept in it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "notebooks").glob("*.ipynb"))


@pytest.fixture
def nbclient() -> Any:
    """The module, which takes long to import."""
    pytest.importorskip("ipykernel", reason="ipykernel is not installed (make docs)")
    return pytest.importorskip("nbclient", reason="nbclient is not installed (make docs)")


@pytest.fixture
def nbformat() -> Any:
    """The module, which takes long to import."""
    return pytest.importorskip("nbformat", reason="nbformat is not installed (make docs)")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_pictures(
    path: Path, nbclient: Any, nbformat: Any, tmp_path: Path
) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    where = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(notebook, timeout=480, resources=where).execute()
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


def test_the_notebooks_kernel_is_this_python(nbclient: Any, nbformat: Any, tmp_path: Path) -> None:
    cell = nbformat.v4.new_code_cell("import sys; print(sys.executable)")
    notebook = nbformat.v4.new_notebook(cells=[cell])
    nbclient.NotebookClient(
        notebook, timeout=480, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    assert notebook.cells[0].outputs[0].text.strip() == sys.executable
