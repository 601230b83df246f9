"""The start of the command `hypermap`: Ctrl-C ends it without a traceback while it loads, too."""

from __future__ import annotations

import sys
from typing import NoReturn


def main() -> NoReturn:
    """Load the command line, and run it with the arguments of this process."""
    try:
        from hypermap.cli.main import main as run  # takes a while, as it loads typer

        run()
    except KeyboardInterrupt:
        sys.exit(130)
