"""The start and the end of the command `hypermap`, where Ctrl-C is no error either."""

from __future__ import annotations

import atexit
import signal
import sys
from typing import NoReturn


def main() -> NoReturn:
    """Load the command line, and run it with the arguments of this process."""
    # Runs last. Python takes some 0.1 s to unload libraries, in which it handles no signals: Ctrl-C
    # would kill a command that is done.
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
    try:
        from hypermap.cli.main import main as run  # takes a while, as it loads typer

        run()
    except KeyboardInterrupt:
        sys.exit(130)
