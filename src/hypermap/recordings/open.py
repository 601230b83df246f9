"""Recognizes the kind of recording at a path."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from hypermap.core.errors import FileMissing, FormatError
from hypermap.perception.recording import PendingRecording
from hypermap.recordings.layouts import layout_of
from hypermap.recordings.options import RecordingOptions

_LOOKED_FOR = (
    "a TUM RGB-D folder (rgb.txt, depth.txt, groundtruth.txt), "
    "a 7-Scenes folder (frame-000000.color.jpg or .png, .depth.png, .pose.txt, ...), "
    "a ScanNet or Open3D folder (depth/0.png, color/0.jpg, pose/0.txt or trajectory.log, ...), "
    "a Replica folder (results/depth000000.png, traj.txt, ...), "
    "a ROS 1 bag (NAME.bag, or a folder of its parts NAME_0.bag, NAME_1.bag, ...) or a ROS 2 bag "
    "(a folder with metadata.yaml, NAME.db3 or NAME.mcap); docs/recordings.md shows how to convert "
    "others"
)
_BAG_ENDINGS = (".bag", ".active", ".db3", ".mcap")
_PACKED = (".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".7z", ".rar", ".zst", ".zstd", ".lz4")


def open_recording(path: str | Path, options: RecordingOptions | None = None) -> PendingRecording:
    """Return the recording at a path, recognized by its files.

    This only checks file names; `info` reports the contents and their problems.

    Raises:
        FileMissing: If there is nothing.
        FormatError: If it is not a recording of a known kind.
    """
    path = Path(path)
    if not path.exists():
        raise FileMissing(f"{path}: there is no such file or folder")
    if not (path.is_file() or path.is_dir()):
        raise FormatError("is neither a file nor a folder", path=path)
    open_it = _recognise(path)
    if open_it is None:
        inside = [] if path.is_file() else sorted(p for p in path.iterdir() if p.is_dir())
        recordings = [p.name for p in inside if _recognise(p) is not None]
        if recordings:
            listed = ", ".join(recordings[:6]) + (", ..." if len(recordings) > 6 else "")
            raise FormatError(
                f"there is a recording one folder down ({listed}); "
                f"name it, as {path / recordings[0]}",
                path=path,
            )
        raise FormatError(f"no recording found{_hint(path)}; looked for {_LOOKED_FOR}", path=path)
    return open_it(path, options or RecordingOptions())


def _hint(path: Path) -> str:
    """Return what may be wrong with a file or folder that is no recording; "" if unknown."""
    if path.suffix == ".hmap":
        return "; this is a map, which --onto continues with a recording"
    inside = [path] if path.is_file() else sorted(path.iterdir())
    if packed := next((p for p in inside if p.suffix.lower() in _PACKED and p.is_file()), None):
        return f"; unpack {packed.name} first"
    if depth := sorted(path.glob("depth/[!.]*")):
        return (
            f"; the files in depth, such as {depth[0].name}, are not PNG images named by the "
            "number of their frame, such as 0.png"
        )
    return ""


def is_recording(path: Path) -> bool:
    """Return whether there is a recording of a known kind at a path, by the names of its files."""
    return (path.is_file() or path.is_dir()) and _recognise(path) is not None


def recordings_in(path: Path) -> list[Path]:
    """Return the recordings in a folder, by name, or what is given, if it is one recording."""
    is_one = path.is_file() or (path / "metadata.yaml").exists()
    inside = [] if is_one else sorted(filter(is_recording, path.iterdir()))
    return inside or [path] * is_recording(path)


def _recognise(path: Path) -> Callable[[Path, RecordingOptions], PendingRecording] | None:
    # Each kind is imported where it is needed: rosbags and Pillow take their time.
    if path.is_file():
        return _bag() if path.suffix in _BAG_ENDINGS else None
    if (path / "metadata.yaml").exists():
        return _bag()
    if any((path / name).exists() for name in ("depth.txt", "rgb.txt", "associations.txt")):
        from hypermap.recordings.tum import TumRecording

        return TumRecording
    if (layout := layout_of(path)) is not None:
        from hypermap.recordings.numbered import NumberedRecording

        return partial(NumberedRecording, layout=layout)
    if any(file.suffix in _BAG_ENDINGS for file in path.iterdir()):
        return _bag()
    return None


def _bag() -> Callable[[Path, RecordingOptions], PendingRecording]:
    from hypermap.recordings.bag.recording import BagRecording

    return BagRecording
