from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

import hypermap


def test_everything_that_is_offered_is_there_and_the_same_as_at_home() -> None:
    for name in hypermap.__all__:
        offered = getattr(hypermap, name)
        if name != "__version__":
            assert getattr(importlib.import_module(offered.__module__), name) is offered
    assert set(dir(hypermap)) == set(hypermap.__all__)


def test_what_is_not_offered_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'hypermap' has no attribute 'open'"):
        hypermap.open  # noqa: B018
    with pytest.raises(AttributeError, match=r"module 'hypermap\.formats' has no attribute 'x'"):
        importlib.import_module("hypermap.formats").x  # noqa: B018


def test_importing_hypermap_imports_no_other_library() -> None:
    code = "import sys, hypermap; print(*{n.partition('.')[0] for n in sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"numpy", "shapely", "yaml", "PIL", "pydantic", "numba"} & set(done.stdout.split())
