from __future__ import annotations

import time

from hypermap.text import visible


def test_a_message_with_many_beginnings_of_addresses_is_shown_at_once() -> None:
    started = time.process_time()
    visible("postgres:/:" * 20_000)
    assert time.process_time() - started < 1


def test_a_password_is_left_out_however_long_it_is() -> None:
    said = visible(f"postgres://me:{'s' * 5000}@db/maps, postgres://me:t@db, postgres://me:8 @")
    assert said == "postgres://me@db/maps, postgres://me@db, postgres://me:8 @"
