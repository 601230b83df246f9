"""Embedders of other packages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.perception.embedders.load import load_embedder

from ...installed import install_package

PLUGIN = """
import numpy as np

class Ones:
    def __init__(self, argument):
        if argument == "end":
            raise SystemExit(3)
        self.model = argument

    def images(self, images):
        return np.ones((len(images), 1), np.float32)

    def texts(self, texts):
        raise RuntimeError("no license")
"""
NAME = r"embedder plug-in 'ones' \(ones:Ones\)"


@pytest.fixture(autouse=True)
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package with an embedder, as pip would install it."""
    (tmp_path / "ones.py").write_text(PLUGIN)
    install_package(tmp_path, "ones", "hypermap.embedders", {"ones": "ones:Ones"})
    monkeypatch.syspath_prepend(tmp_path)


def test_an_embedder_of_another_package_gets_what_stands_after_its_name() -> None:
    embedder = load_embedder("ones:mine")
    assert embedder.model == "mine"
    assert embedder.images([np.zeros((2, 3, 3), np.uint8)]).tolist() == [[1.0]]


def test_an_embedder_that_ends_the_program_is_named() -> None:
    with pytest.raises(HypermapError, match=f"{NAME} cannot be created from 'end': SystemExit: 3"):
        load_embedder("ones:end")


def test_an_embedder_that_fails_is_named() -> None:
    with pytest.raises(HypermapError, match=f"{NAME} cannot embed texts: RuntimeError: no license"):
        load_embedder("ones:mine").texts(["a chair"])
