"""Images of random worlds to train on: some processes render them, and the newest are kept."""

from __future__ import annotations

from collections.abc import Iterator
from threading import Event, Thread

import numpy as np
import torch
from network import INPUT_SIZE
from render_images import render_world
from torch import Tensor
from torch.utils.data import DataLoader, IterableDataset, get_worker_info

from hypermap.perception.detectors.placement import BORDER, centered

IMAGE_SIZE = (320, 240)
MOST_OBJECTS = 80  # in an image; the smallest of more are left out
IMAGES_PER_WORLD = 12


class RandomWorlds(IterableDataset):
    """What `render_world` returns of one world after the other, without end."""

    def __init__(self, first: int) -> None:
        """Take the number of the first world."""
        super().__init__()
        self._first = first

    def __iter__(self) -> Iterator[dict[str, np.ndarray]]:
        """Yield the worlds of this process."""
        torch.set_num_threads(1)
        worker = get_worker_info()
        number = self._first + worker.id
        while True:
            yield render_world(number, IMAGES_PER_WORLD)
            number += worker.num_workers


class Images:
    """The newest images with their objects, in the memory of the device that trains."""

    def __init__(self, capacity: int, processes: int, first_world: int = 0) -> None:
        """Begin to render.

        This comes before anything is done on a GPU, which processes cannot share.

        Args:
            capacity: how many images are kept, 0.23 MB each.
            processes: how many processes render.
            first_world: number of the first world, to go on with others than before.
        """
        render_world(0, 1)  # compiles, once for all processes
        loader = DataLoader(
            RandomWorlds(first_world),
            batch_size=None,
            num_workers=processes,
            prefetch_factor=8,
            in_order=False,
        )
        self._worlds = iter(loader)
        self._capacity = capacity
        self._is_enough = Event()
        self.rendered = 0

    def keep_on(self, device: torch.device) -> None:
        """Keep the images on a device from now on, as they come."""
        shape = (self._capacity, IMAGE_SIZE[1], IMAGE_SIZE[0], 3)
        self._images = torch.empty(shape, dtype=torch.uint8, device=device)
        self._boxes = torch.zeros((self._capacity, MOST_OBJECTS, 4), device=device)
        self._classes = torch.full((self._capacity, MOST_OBJECTS), -1, device=device)
        self._receiver = Thread(target=self._receive, daemon=True)
        self._receiver.start()

    def end(self) -> None:
        """Render no more."""
        self._is_enough.set()
        self._receiver.join()
        del self._worlds

    def _receive(self) -> None:
        for world in self._worlds:
            if self._is_enough.is_set():
                return
            count = len(world["images"])
            boxes = torch.zeros((count, MOST_OBJECTS, 4))
            classes = torch.full((count, MOST_OBJECTS), -1)
            for i in range(count):
                mine = world["image_ids"] == i
                found, names = world["boxes"][mine], world["classes"][mine]
                largest = (found[:, 2:] - found[:, :2]).prod(1).argsort(descending=True)
                largest = largest[:MOST_OBJECTS]
                boxes[i, : len(largest)], classes[i, : len(largest)] = (
                    found[largest],
                    names[largest],
                )
            at = torch.arange(self.rendered, self.rendered + count) % self._capacity
            at = at.to(self._images.device)
            self._images[at] = world["images"].to(at.device)
            self._boxes[at], self._classes[at] = boxes.to(at.device), classes.to(at.device)
            self.rendered += count

    def batch(self, size: int) -> tuple[Tensor, Tensor, Tensor]:
        """Return images as the network gets them, mirrored and colored by chance; see `Network`.

        Returns:
            Images, shape (B, 3, 256, 320); boxes, shape (B, M, 4); classes, shape (B, M).
        """
        device = self._images.device
        chosen = torch.randint(min(self.rendered, self._capacity), (size,), device=device)
        images = self._images[chosen].permute(0, 3, 1, 2).float() / 255  # channels last in memory
        boxes, classes = self._boxes[chosen], self._classes[chosen]
        most = max(1, int((classes >= 0).sum(1).max()))
        boxes, classes = boxes[:, :most].clone(), classes[:, :most]
        is_mirrored = torch.rand(size, device=device) < 0.5
        images[is_mirrored] = images[is_mirrored].flip(3)
        mirrored = boxes[is_mirrored]
        left, right = IMAGE_SIZE[0] - mirrored[..., 2], IMAGE_SIZE[0] - mirrored[..., 0]
        boxes[is_mirrored] = torch.stack([left, mirrored[..., 1], right, mirrored[..., 3]], -1)

        placement = centered(IMAGE_SIZE, INPUT_SIZE)
        shift = torch.tensor([placement.left, placement.top] * 2, device=device)
        boxes = torch.where((classes >= 0).unsqueeze(2), boxes + shift, 0.0)
        below = INPUT_SIZE[1] - IMAGE_SIZE[1] - placement.top
        padding = (0, 0, placement.top, below)
        padded = torch.nn.functional.pad(_colored(images), padding, value=BORDER / 255)
        return padded.contiguous(memory_format=torch.channels_last), boxes, classes


def _colored(images: Tensor) -> Tensor:
    """Return images (0..1), shape (B, 3, H, W), each in another light, some with a little noise."""
    count, device = len(images), images.device

    def drawn(low: float, high: float, channels: int = 1) -> Tensor:
        return low + (high - low) * torch.rand((count, channels, 1, 1), device=device)

    gain = drawn(0.6, 1.3) * drawn(0.9, 1.1, 3)
    colored = images ** drawn(0.8, 1.3) * gain + drawn(-0.06, 0.06)
    noise = torch.randn((count, 1, *images.shape[2:]), device=device)
    return (colored + noise * 0.012 * (drawn(0, 1) < 0.3)).clamp(0, 1)
