"""Renders images of random worlds, with a box around what is visible of each object.

    python training/render_images.py kept --first 5000000 --worlds 100

`train_detector.py` renders its own images while it trains, from 0 on; this saves others, which are
kept to measure on. Each world becomes a file `NNNNN.npz` in the folder; files that are there are
left as they are.
"""

from __future__ import annotations

import argparse
from multiprocessing import Pool
from pathlib import Path

import numpy as np
from random_worlds import RandomWorld

from hypermap.simulation.detector import visible_boxes
from hypermap.simulation.network import CLASSES, class_of
from hypermap.simulation.render import DEFAULT_CAMERA
from hypermap.simulation.views import Views

SEED = 20190412
MIN_PIXELS = 40  # of an object, below which it is no object to learn


def render_world(number: int, images: int) -> dict[str, np.ndarray]:
    """Return images of one random world and what is in them.

    Returns:
        `images` RGB, uint8, shape (N, 240, 320, 3); and for each of M objects in any of them
        `boxes` (xmin, ymin, xmax, ymax), shape (M, 4), `classes` and `image_ids`, shape (M,).
    """
    room = RandomWorld(np.random.default_rng([SEED, number]))
    world = room.world()
    views = Views(world, DEFAULT_CAMERA)
    class_ids = np.array([CLASSES.index(class_of(thing)) for thing in world.objects], dtype=int)
    pictures, boxes, classes, image_ids = [], [], [], []
    for i in range(images):
        view = views.seen(room.camera_pose())
        pixels = np.bincount(view.instances[view.instances >= 0], minlength=len(class_ids))
        visible = pixels >= MIN_PIXELS
        pictures.append(view.color)
        boxes.append(visible_boxes(view.instances, len(class_ids))[visible])
        classes.append(class_ids[visible])
        image_ids.append(np.full(visible.sum(), i))
    return {
        "images": np.stack(pictures),
        "boxes": np.concatenate(boxes).astype(np.float32),
        "classes": np.concatenate(classes),
        "image_ids": np.concatenate(image_ids),
    }


def _save(job: tuple[Path, int, int]) -> None:
    folder, number, images = job
    path = folder / f"{number:05d}.npz"
    if not path.exists():
        partial = path.with_suffix(".partial.npz")
        np.savez(partial, **render_world(number, images))
        partial.replace(path)


def main() -> None:
    """Render what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--worlds", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="number of the first world")
    parser.add_argument("--images", type=int, default=12, help="of each world")
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    numbers = range(arguments.first, arguments.first + arguments.worlds)
    jobs = [(arguments.folder, i, arguments.images) for i in numbers]
    with Pool(arguments.processes) as pool:
        for _ in pool.imap_unordered(_save, jobs):
            pass


if __name__ == "__main__":
    main()
