"""Compiled loops give back the memory of the arrays that they make."""

from __future__ import annotations

import ast
import dataclasses
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest
from numba.core.runtime import _nrt_python, rtsys

from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.perception.config import Method
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import RgbdFrame
from hypermap.simulation import SimulatedRecording, demo_world
from hypermap.simulation.render import DEFAULT_CAMERA

SOURCES = Path(__file__).resolve().parents[1] / "src" / "hypermap"


@pytest.fixture(scope="module")
def frames() -> list[RgbdFrame]:
    recording = SimulatedRecording(demo_world(), camera=DEFAULT_CAMERA.every(4), rate=0.5)
    return list(islice(recording.frames(), 3))


@pytest.fixture
def counted() -> Iterator[None]:
    _nrt_python.memsys_enable_stats()
    yield
    _nrt_python.memsys_disable_stats()


@pytest.mark.usefixtures("counted")
@pytest.mark.parametrize("method", ["enclosed", "organised", "unorganised"])
def test_mapping_gives_back_what_compiled_loops_allocate(
    method: Method, frames: list[RgbdFrame]
) -> None:
    config = profile("thesis")
    config = dataclasses.replace(
        config, perception=dataclasses.replace(config.perception, method=method)
    )
    before = rtsys.get_allocation_stats()
    mapper = Mapper(config, detections_from_recording())
    for frame in frames:
        assert mapper.add(frame) is not None
    del mapper
    after = rtsys.get_allocation_stats()
    assert after.mi_alloc - before.mi_alloc == after.mi_free - before.mi_free


def test_who_calls_a_loop_that_allocates_counts_references_as_well() -> None:
    loops = dict(compiled_loops())
    makers = {name for name, (allocates, _) in loops.items() if allocates}
    assert len(loops) > 50
    assert makers
    careless = {name for name, (allocates, calls) in loops.items() if not allocates}
    assert {name: loops[name][1] & makers for name in careless if loops[name][1] & makers} == {}


def compiled_loops() -> Iterator[tuple[str, tuple[bool, set[str]]]]:
    """Yield the name of each compiled loop, whether it counts references, and what it calls."""
    for path in SOURCES.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.FunctionDef):
                continue
            for made_by in node.decorator_list:
                if isinstance(made_by, ast.Call) and _name(made_by.func) in ("loop", "inner_loop"):
                    allocates = any(word.arg == "allocates" for word in made_by.keywords)
                    calls = [item for item in ast.walk(node) if isinstance(item, ast.Call)]
                    yield node.name, (allocates, {_name(call.func) for call in calls})


def _name(function: ast.expr) -> str:
    return function.id if isinstance(function, ast.Name) else ""
