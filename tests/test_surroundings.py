"""No test sees what another left behind, nor what a fixture that many share did."""

from __future__ import annotations

import logging

import pytest


@pytest.fixture(scope="module")
def level_when_silenced() -> int:
    logging.getLogger("hypermap").setLevel(logging.CRITICAL)
    return logging.getLogger("hypermap").level


def test_a_fixture_of_a_module_silences_no_test(
    level_when_silenced: int, caplog: pytest.LogCaptureFixture
) -> None:
    assert level_when_silenced == logging.CRITICAL
    logging.getLogger("hypermap").warning("heard")
    assert "heard" in caplog.text
