"""What became of the frames that a mapper was given."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Counts:
    """What became of the frames so far.

    Attributes:
        used: mapped frames.
        skipped: frames that are no keyframes, because the camera had hardly moved.
        unusable: frames that cannot be read, have no depth or no valid pose, or for which the
            source of detections failed.
        repeated: frames that are in the map already, from an earlier drive.
    """

    used: int = 0
    skipped: int = 0
    unusable: int = 0
    repeated: int = 0

    @property
    def frames(self) -> int:
        """All frames so far."""
        return self.used + self.skipped + self.unusable + self.repeated

    def __add__(self, other: Counts) -> Counts:
        return Counts(**{fate: count + getattr(other, fate) for fate, count in vars(self).items()})

    def told(self) -> dict[str, int]:
        """Return the counts by name, for a map's metadata."""
        told = asdict(self)
        return told if self.repeated else {k: v for k, v in told.items() if k != "repeated"}
