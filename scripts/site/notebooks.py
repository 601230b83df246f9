"""Notebooks as pages: each is run, and shown with what it printed and drew."""

from __future__ import annotations

import tempfile
from pathlib import Path

import nbformat
from nbconvert import MarkdownExporter
from traitlets.config import Config

TIME_LIMIT = 600  # s, for a cell


def page(path: Path, *, execute: bool) -> dict[str, str | bytes]:
    """Return a notebook's page and its pictures, by their places in the site."""
    notebook = nbformat.read(path, as_version=4)
    if execute:
        run(notebook)
    exporter = MarkdownExporter(
        config=Config(
            {
                "NbConvertBase": {
                    "display_data_priority": ["image/png", "text/markdown", "text/plain"]
                }
            }
        )
    )
    resources = {"output_files_dir": f"{path.stem}_files"}
    markdown, resources = exporter.from_notebook_node(notebook, resources)
    pictures = {f"notebooks/{name}": data for name, data in resources["outputs"].items()}
    return {f"notebooks/{path.stem}.md": markdown, **pictures}


def run(notebook: nbformat.NotebookNode) -> None:
    """Run a notebook in an empty folder; its outputs are stored in it.

    Raises:
        nbclient.exceptions.CellExecutionError: If a cell fails.
    """
    from nbclient import NotebookClient  # takes long to import

    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(
            notebook, timeout=TIME_LIMIT, resources={"metadata": {"path": folder}}
        ).execute()
