"""What all tests share."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

# No deadlines: machines are noisy, and numba compiles on the first call. CI draws the same
# examples each time, so that it is red only for a reason that can be repeated.
settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real maps and recordings that lies next to the checkout, where there is one."""
    if not SHARED_DATA.is_dir():
        pytest.skip("the real maps and recordings are not here (put them into ../shared/data)")
    return SHARED_DATA


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C interrupts this process; shells switch it off for the jobs of a script."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def demo_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `hypermap demo --keep-recording` makes; its tests share the xdist group "demo"."""
    folder = tmp_path_factory.mktemp("demo") / "hypermap-demo"
    command = [
        sys.executable,
        "-m",
        "hypermap",
        "demo",
        "--folder",
        str(folder),
        "--keep-recording",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder
