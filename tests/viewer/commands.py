"""`hypermap` as a process: run to its end, and with a browser that notes what it is to open."""

from __future__ import annotations

import os
import shlex
import subprocess
import time
from pathlib import Path
from typing import Any

from ..prepared import Command, run

PATIENCE = 240.0  # s; the machine may be busy, and loops may have to be compiled


def hypermap(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command to its end."""
    return run(*arguments, cwd=cwd, timeout=PATIENCE)


def started(*arguments: object, **options: Any) -> Command:
    """Start the command, with a pipe from its standard output."""
    return Command(*arguments, stdout=subprocess.PIPE, **options)


def said_and_opened(folder: Path, *arguments: object) -> tuple[str, str]:
    """Return the address that a command prints, and that which its browser is to open.

    Args:
        folder: where the browser is written.
        arguments: of a command that serves a page until it is ended.
    """
    opened, browser = folder / "opened", folder / "browser.sh"
    at = shlex.quote(str(opened))
    browser.write_text(f'#!/bin/sh\necho "$1" > {at}.tmp && mv {at}.tmp {at}\n')
    browser.chmod(0o755)
    environment = {**os.environ, "BROWSER": str(browser)}
    process = started(*arguments, stderr=subprocess.DEVNULL, env=environment)
    try:
        assert process.stdout is not None
        said = process.stdout.readline().strip()
        end = time.monotonic() + PATIENCE
        while not opened.exists() and time.monotonic() < end:
            time.sleep(0.1)
        return said, opened.read_text().strip()
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE)


def at(url: str, path: str) -> str:
    """Return the address of something next to the page whose address was printed."""
    base, _, query = url.partition("?")
    return f"{base}{path}{'&' if '?' in path else '?'}{query}"
