"""A tree of frames that move relative to each other, as on a robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hypermap.core.errors import FrameError, did_you_mean
from hypermap.core.trajectory import compose, invert


class Motion(Protocol):
    """The pose of one frame in another, over time; a `Trajectory` is one."""

    def covers(self, stamps: ArrayLike) -> NDArray[np.bool_]:
        """Return whether the pose is known at each stamp [s], shape (M,)."""
        ...

    def at(self, stamps: ArrayLike) -> NDArray[np.float64]:
        """Return the poses at stamps [s], shape (M, 4, 4).

        Raises:
            FrameError: If the pose is not known at one of them.
        """
        ...


@dataclass(frozen=True, eq=False)
class FixedPose:
    """A frame that does not move; its pose, shape (4, 4), is known at any time."""

    pose: NDArray[np.float64]

    def covers(self, stamps: ArrayLike) -> NDArray[np.bool_]:
        """Return True for each stamp, shape (M,)."""
        return np.ones(len(np.atleast_1d(stamps)), dtype=bool)

    def at(self, stamps: ArrayLike) -> NDArray[np.float64]:
        """Return the pose, once for each stamp, shape (M, 4, 4)."""
        return np.repeat(self.pose[np.newaxis], len(np.atleast_1d(stamps)), axis=0)


@dataclass(frozen=True, eq=False)
class Inverse:
    """The inverse of a motion."""

    motion: Motion

    def covers(self, stamps: ArrayLike) -> NDArray[np.bool_]:
        """Return whether the motion is known at each stamp [s], shape (M,)."""
        return self.motion.covers(stamps)

    def at(self, stamps: ArrayLike) -> NDArray[np.float64]:
        """Return the inverse poses at stamps [s], shape (M, 4, 4)."""
        return invert(self.motion.at(stamps))


@dataclass(frozen=True, eq=False)
class Chain:
    """A chain of motions: `a_T_b`, `b_T_c`, ... composed to `a_T_z`."""

    links: tuple[Motion, ...]

    def covers(self, stamps: ArrayLike) -> NDArray[np.bool_]:
        """Return whether every link is known at each stamp [s], shape (M,)."""
        known = np.ones(len(np.atleast_1d(stamps)), dtype=bool)
        for link in self.links:
            known &= link.covers(stamps)
        return known

    def at(self, stamps: ArrayLike) -> NDArray[np.float64]:
        """Return the composed poses at stamps [s], shape (M, 4, 4)."""
        identities = FixedPose(np.eye(4)).at(stamps)
        return compose(identities, *(link.at(stamps) for link in self.links))


class MovingFrames:
    """A tree of frames: every frame except the roots moves in one parent.

    >>> pose = np.eye(4)
    >>> pose[0, 3] = 2.0
    >>> tree = MovingFrames({"camera": ("base", FixedPose(pose)), "base": ("map", FixedPose(pose))})
    >>> tree.motion("map", "camera").at([0.0])[0, 0, 3]
    np.float64(4.0)

    Args:
        edges: for each child frame, its parent and its motion in the parent, `parent_T_child`.

    Raises:
        FrameError: If the frames form a loop.
    """

    def __init__(self, edges: Mapping[str, tuple[str, Motion]]) -> None:
        self._edges = dict(edges)
        for frame in self._edges:
            self._to_root(frame)

    @property
    def frames(self) -> list[str]:
        """All frames; parents come first if they were given first."""
        names = (name for child, (parent, _) in self._edges.items() for name in (parent, child))
        return list(dict.fromkeys(names))

    @property
    def roots(self) -> list[str]:
        """The frames without a parent."""
        return [name for name in self.frames if name not in self._edges]

    def root_of(self, frame: str) -> str:
        """Return the topmost frame above a frame; the frame itself if it has no parent."""
        return list(self._to_root(frame))[-1]

    def moves(self, frame: str) -> bool:
        """Return whether a frame moves relative to its root."""
        links = self._to_root(frame)[self.root_of(frame)]
        return not all(isinstance(link, FixedPose) for link in links)

    def motion(self, target: str, source: str) -> Motion:
        """Return the motion `target_T_source`.

        Raises:
            FrameError: If a frame is unknown or the two are not connected.
        """
        for name in (target, source):
            if name not in self.frames:
                raise FrameError(f"there is no frame {name!r}; {did_you_mean(name, self.frames)}")
        up, down = self._to_root(target), self._to_root(source)
        shared = next((frame for frame in down if frame in up), None)
        if shared is None:
            raise FrameError(
                f"frames {target!r} and {source!r} are not connected: the first is below "
                f"{list(up)[-1]!r}, the second below {list(down)[-1]!r}"
            )
        return Chain((Inverse(Chain(up[shared])), Chain(down[shared])))

    def edges_between(self, one: str, other: str) -> dict[tuple[str, str], Motion]:
        """Return the motion `parent_T_child` of each parent and child between two frames."""
        up, down = self._to_root(one), self._to_root(other)
        apart = [
            frame for path in (up, down) for frame in path if not (frame in up and frame in down)
        ]
        return {(self._edges[child][0], child): self._edges[child][1] for child in apart}

    def _to_root(self, frame: str) -> dict[str, tuple[Motion, ...]]:
        """Return the frame and its ancestors, each with the links down to `frame`."""
        path: dict[str, tuple[Motion, ...]] = {frame: ()}
        at = frame
        while at in self._edges:
            parent, motion = self._edges[at]
            if parent in path:
                names = list(path)
                loop = " below ".join([*names[names.index(parent) :], parent])
                raise FrameError(f"the frames {loop} form a loop")
            path[parent] = (motion, *path[at])
            at = parent
        return path
