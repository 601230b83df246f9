"""Nothing but ROS needs what only POSIX systems have: the commands under Windows' rules.

They run in a Python from which these things have been taken away, and in which a file that is open
can neither be replaced nor deleted. It stays Linux for the rest.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

# Libraries choose what to use as they are imported, so this comes first.
WINDOWS = """
import asyncio, os, pathlib, shutil, signal, socket, subprocess, sys, tempfile, uuid
import matplotlib.pyplot, numba, onnxruntime, PIL.Image, prompt_toolkit, rich.console
import rosbags.highlevel, scipy, shapely, typer, uvicorn, yaml

for module in ("fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"):
    sys.modules[module] = None
gone = {
    os: "chown fchmod fchown fork getegid geteuid getgid getpgid getuid kill killpg lchown mkfifo "
        "O_DIRECTORY O_NOFOLLOW O_CLOEXEC O_NONBLOCK setsid sched_getaffinity statvfs uname",
    signal: "alarm pthread_kill pthread_sigmask setitimer sigwait SIGALRM SIGCHLD SIGHUP SIGKILL "
            "SIGPIPE SIGUSR1 SIGUSR2",
    socket: "AF_UNIX",
}
for module, names in gone.items():
    for name in names.split():
        delattr(module, name)

opened = "/proc/self/fd"

def is_open(path):
    real = os.path.realpath(path)
    for handle in os.listdir(opened):
        try:
            if os.readlink(f"{opened}/{handle}") == real:
                return True
        except OSError:
            pass
    return False

def refuse(call):
    def checked(*paths, **others):
        for path in paths:
            if is_open(path):
                raise PermissionError(13, "The process cannot access the file", str(path))
        return call(*paths, **others)
    return checked

open_file = os.open

def no_folders(path, flags, *arguments, **others):
    if os.path.isdir(path) and not flags & os.O_RDWR:  # tempfile opens them so on Linux
        raise PermissionError(13, "Permission denied", str(path))
    return open_file(path, flags, *arguments, **others)

os.open = no_folders
for name in ("replace", "rename", "remove", "unlink"):
    setattr(os, name, refuse(getattr(os, name)))

from hypermap.cli.main import main
"""

RUN = """
def run(line, code=0):
    try:
        main(line.split())
    except SystemExit as end:
        assert (end.code or 0) == code, (line, end.code)

run("simulate demo -o drive --rate 0.1 --image-size 320x240")
run("info drive")
run("map drive --detections drive/detections.json -o room.hmap")
run("map drive --detections drive/detections.json -o room.hmap --force")
run("query room.hmap --at 1,1")
run("render room.hmap -o room.png")
run("view room.hmap --html room.html")
for ending in ("yaml", "geojson", "csv", "parquet"):
    run(f"convert room.hmap objects.{ending} --layer semantic")
    run(f"convert room.hmap objects.{ending} --layer semantic --force")
run("convert room.hmap folder")
run("convert room.hmap folder --force")
run("info folder")
run("evaluate room.hmap drive/truth.hmap")
run("detectors")
run("info nothing.hmap", code=2)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc for files that are open")
def test_commands_keep_to_the_rules_of_windows(tmp_path: Path) -> None:
    program = tmp_path / "windows.py"
    program.write_text(WINDOWS + RUN)
    done = subprocess.run(
        [sys.executable, program], cwd=tmp_path, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    assert "Traceback" not in done.stderr
    left = {path.name for path in tmp_path.iterdir()}
    assert {"room.hmap", "room.png", "room.html", "objects.parquet", "folder"} <= left
    assert not [name for name in left if name.startswith(".hypermap")]
