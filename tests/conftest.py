"""What all tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real maps and recordings that lies beside the checkout, where there is one."""
    if not SHARED_DATA.is_dir():
        pytest.skip("the folder ../shared/data with real maps and recordings is not here")
    return SHARED_DATA
