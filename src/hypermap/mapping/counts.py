"""Frame counts of a mapper: used, skipped, unusable and repeated."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Counts:
    """Counts of the frames so far.

    Attributes:
        used: mapped frames.
        skipped: frames that are not keyframes, because the camera had hardly moved.
        unusable: frames that cannot be read, have no depth or no valid pose, or for which the
            source of detections failed.
        repeated: frames that the map already contains, from an earlier drive.
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

    def as_metadata(self) -> dict[str, int]:
        """Return the counts by name, for a map's metadata."""
        counts = asdict(self)
        return counts if self.repeated else {k: v for k, v in counts.items() if k != "repeated"}
