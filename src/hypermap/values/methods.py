"""The names of the methods that interpolate samples; see `interpolation`."""

from __future__ import annotations

from typing import Literal, get_args

Method = Literal["gmrf", "kernel", "nearest"]
METHODS: tuple[str, ...] = get_args(Method)
