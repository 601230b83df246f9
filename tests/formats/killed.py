"""Saves that are killed, as by SIGKILL, just before a rename: no Python runs after that."""

from __future__ import annotations

import subprocess
import sys

_PROGRAM = """
import os, sys
from pathlib import Path
left, replace = int(sys.argv[1]), Path.replace
def replace_or_die(temporary, target):
    global left
    if left == 0:
        os._exit(9)
    left -= 1
    return replace(temporary, target)
Path.replace = replace_or_die
"""


def killed_at(rename: int, program: str, *words: str) -> bool:
    """Run a program, with words from `sys.argv[2]` on; return whether it came to a rename.

    Where several files are saved, the first rename is the journal's.
    """
    command = [sys.executable, "-c", _PROGRAM + program, str(rename), *words]
    code = subprocess.run(command, check=False).returncode
    assert code in (0, 9)
    return code == 9
