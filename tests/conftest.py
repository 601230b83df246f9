"""What all tests share."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

# No deadlines: machines are noisy, and numba compiles on the first call. The same examples are
# drawn each time, so that a run is red for what was changed; `pytest --hypothesis-profile=explore`
# draws others, ten times as many where a test does not say how many.
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("repeatable")

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real maps and recordings that lies next to the checkout, where there is one."""
    if not SHARED_DATA.is_dir():
        pytest.skip("the real maps and recordings are not here (put them into ../shared/data)")
    return SHARED_DATA


@pytest.fixture(scope="session")
def json_validator() -> Any:
    """The class that checks values by a JSON schema; its library takes seconds to import."""
    from jsonschema import Draft202012Validator

    return Draft202012Validator


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C interrupts this process; shells switch it off for the jobs of a script."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def demo_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `hypermap demo --keep-recording` makes; its tests share the xdist group "demo"."""
    from .prepared import run

    folder = tmp_path_factory.mktemp("demo") / "hypermap-demo"
    done = run("demo", "--folder", folder, "--keep-recording")
    assert done.returncode == 0, done.stderr
    return folder
