"""Points as arguments of a command, which may begin with a minus sign."""

from __future__ import annotations

import re
from typing import Any

from typer.core import TyperCommand


class PointsCommand(TyperCommand):
    """Takes points as -1,2 for places, not for options."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments; what is behind a blank is no option."""
        return super().parse_args(
            ctx, [f" {word}" if re.match(r"-[\d.]+,", word) else word for word in args]
        )
