"""A small one-stage detector without anchors, with one box for each cell of 8, 16 and 32 pixels."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

STRIDES = (8, 16, 32)
INPUT_SIZE = (320, 256)  # columns and rows
_NECK = 64  # channels
_RARE = -4.6  # bias of the scores: one cell in a hundred shows an object of a class


class Network(nn.Module):
    """Backbone, feature pyramid, and a head that all levels share.

    It takes RGB from 0 to 1, shape (B, 3, 256, 320), and returns for its N cells their distances to
    the left, upper, right and lower side of the box [pixels], shape (B, N, 4), and the logits
    of the classes, shape (B, N, classes).
    """

    def __init__(self, class_count: int) -> None:
        """Make an untrained network."""
        super().__init__()
        self.stem = nn.Sequential(_conv(3, 16, 3, 2), _conv(16, 32, 3, 2), _Block(32))
        self.down8 = nn.Sequential(_conv(32, 64, 3, 2), *(_Block(64) for _ in range(3)))
        self.down16 = nn.Sequential(_conv(64, 96, 3, 2), *(_Block(96) for _ in range(3)))
        self.down32 = nn.Sequential(_conv(96, 128, 3, 2), _Block(128))
        self.lateral = nn.ModuleList(_conv(channels, _NECK, 1) for channels in (64, 96, 128))
        self.smooth = nn.ModuleList(_conv(_NECK, _NECK, 3) for _ in range(2))
        self.to_classes = _Head(class_count, bias=_RARE, depth=2)
        self.to_sides = _Head(4, bias=0.7, depth=1)
        points, strides = _cells()
        self.register_buffer("points", points)
        self.register_buffer("strides", strides)

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Return sides and logits."""
        x8 = self.down8(self.stem(images))
        x16 = self.down16(x8)
        x32 = self.down32(x16)
        p8, p16, p32 = (layer(x) for layer, x in zip(self.lateral, (x8, x16, x32), strict=True))
        p16 = self.smooth[1](p16 + functional.interpolate(p32, scale_factor=2.0))
        p8 = self.smooth[0](p8 + functional.interpolate(p16, scale_factor=2.0))
        levels = (p8, p16, p32)
        sides = torch.exp(self.to_sides(levels).float().clamp(-4, 5))
        return sides * self.strides, self.to_classes(levels).float()

    def boxes(self, sides: Tensor) -> Tensor:
        """Return (xmin, ymin, xmax, ymax) [pixels] of the cells' boxes, shape (B, N, 4)."""
        return torch.cat([self.points - sides[..., :2], self.points + sides[..., 2:]], -1)


class Exported(nn.Module):
    """The network as it is saved: one array of (x, y, w, h, scores), shape (B, 4 + classes, N)."""

    def __init__(self, network: Network) -> None:
        """Wrap a trained network."""
        super().__init__()
        self.network = network

    def forward(self, images: Tensor) -> Tensor:
        """Return the array."""
        sides, logits = self.network(images)
        centers = self.network.points + (sides[..., 2:] - sides[..., :2]) / 2
        sizes = sides[..., :2] + sides[..., 2:]
        return torch.cat([centers, sizes, logits.sigmoid()], -1).transpose(1, 2)


class _Block(nn.Module):
    """A residual block with a narrow middle."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.inner = nn.Sequential(
            _conv(channels, channels // 2, 1), _conv(channels // 2, channels, 3)
        )

    def forward(self, x: Tensor) -> Tensor:
        return x + self.inner(x)


class _Head(nn.Module):
    """What each cell says; the levels are normalized together, as they share the weights."""

    def __init__(self, outputs: int, bias: float, depth: int) -> None:
        super().__init__()
        self.convs = nn.ModuleList(
            nn.Conv2d(_NECK, _NECK, 3, padding=1, bias=False) for _ in range(depth)
        )
        self.norms = nn.ModuleList(nn.BatchNorm1d(_NECK) for _ in range(depth))
        self.last = nn.Conv1d(_NECK, outputs, 1)
        nn.init.constant_(self.last.bias, bias)

    def forward(self, levels: Sequence[Tensor]) -> Tensor:
        """Return numbers for each cell, shape (B, N, outputs)."""
        shapes = [level.shape[2:] for level in levels]
        for conv, norm in zip(self.convs, self.norms, strict=True):
            convolved = torch.cat([conv(level).flatten(2) for level in levels], 2)
            joined = functional.relu(norm(convolved))
            parts = joined.split([rows * columns for rows, columns in shapes], 2)
            levels = [part.unflatten(2, shape) for part, shape in zip(parts, shapes, strict=True)]
        return self.last(joined).transpose(1, 2)


def _conv(inputs: int, outputs: int, size: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


def _cells() -> tuple[Tensor, Tensor]:
    """Return the center of every cell [pixels], shape (N, 2), and its stride, shape (N, 1)."""
    points, strides = [], []
    for stride in STRIDES:
        columns, rows = (side // stride for side in INPUT_SIZE)
        y, x = torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")
        points.append((torch.stack([x.flatten(), y.flatten()], 1) + 0.5) * stride)
        strides.append(torch.full((rows * columns, 1), float(stride)))
    return torch.cat(points), torch.cat(strides)
