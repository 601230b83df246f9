"""`hypermap` as a process: run to its end, and with a browser that notes what it is to open."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

PATIENCE = 240.0  # s; the machine may be busy, and loops may have to be compiled


def hypermap(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command to its end."""
    return subprocess.run(
        command(*arguments),
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


def started(*arguments: object, **options: Any) -> subprocess.Popen[str]:
    """Start the command so that Ctrl-C reaches it, which some shells keep from programs."""
    return subprocess.Popen(
        command(*arguments),
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        **options,
    )


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


def command(*arguments: object) -> list[str]:
    """Return the words of a command of this checkout."""
    return [sys.executable, "-m", "hypermap", *map(str, arguments)]


def at(url: str, path: str) -> str:
    """Return the address of something next to the page whose address was printed."""
    base, _, query = url.partition("?")
    return f"{base}{path}{'&' if '?' in path else '?'}{query}"
