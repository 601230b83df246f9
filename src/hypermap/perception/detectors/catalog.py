"""Networks known by name, and where their downloads are stored."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from hypermap.core.errors import FileMissing, FormatError

_YOLOX = "https://github.com/Megvii-BaseDetection/YOLOX/releases/download/0.1.1rc0"


@dataclass(frozen=True)
class KnownNetwork:
    """A network that its authors offer as an ONNX file.

    Attributes:
        name: its name for `--detector`.
        url: where its file comes from.
        sha256: of the file, in hexadecimal digits.
        size: of the file [bytes].
        license: SPDX identifier of the license of network and weights.
        classes: how many, and of which data set.
        source: its authors.
        note: our experience with it.
    """

    name: str
    url: str
    sha256: str
    size: int
    license: str
    classes: str
    source: str
    note: str

    @property
    def path(self) -> Path:
        """Its path in the user's cache, whether or not it exists."""
        return download_folder() / self.url.rpartition("/")[2]

    def downloaded(self) -> Path:
        """Return its file.

        Raises:
            FileMissing: If it has not been downloaded.
            FormatError: If another file is at its path.
        """
        if not self.path.is_file():
            raise FileMissing(
                f"{self.name} was not downloaded yet: run `hypermap detectors get {self.name}` "
                f"({self.size / 1e6:.1f} MB, once)"
            )
        size = self.path.stat().st_size
        if size != self.size:
            raise FormatError(
                f"{size} bytes, where {self.name} has {self.size}; run `hypermap detectors get "
                f"{self.name}` to download it again",
                path=self.path,
            )
        return self.path


def download_folder() -> Path:
    """Return the folder of downloaded networks: `hypermap/detectors` in the user's cache."""
    caches = os.environ.get("XDG_CACHE_HOME", "")
    # The XDG Base Directory Specification: relative paths are ignored.
    root = Path(caches) if Path(caches).is_absolute() else Path.home() / ".cache"
    return root / "hypermap" / "detectors"


# Networks that we tried. Several projects that pin this file state the same size and hash; we
# measured an export of the same weights, of 3.68 MB.
NETWORKS = (
    KnownNetwork(
        name="yolox-nano",
        url=f"{_YOLOX}/yolox_nano.onnx",
        sha256="c789161ed43c8269fcd4e67c67eeeb4e80c622da2eb296a20bc6007bd18a0b7d",
        size=3_659_407,
        license="Apache-2.0",
        classes="80 of COCO",
        source="YOLOX 0.1.1rc0, Megvii",
        note="tried; 22 ms an image on two cores",
    ),
)


def known_network(name: str) -> KnownNetwork | None:
    """Return the network of that name; None if there is none."""
    return next((network for network in NETWORKS if network.name == name), None)
