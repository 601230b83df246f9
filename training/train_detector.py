"""Trains the detector for rendered images, and saves it as ONNX.

    python training/render_images.py images
    python training/train_detector.py images -o src/hypermap/simulation/detector.onnx

It needs PyTorch and onnx, and runs on the CPU. `benchmarks/detector.py` measures what came out.
"""

from __future__ import annotations

import argparse
import copy
import math
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
import torch
from loss import detection_loss
from network import INPUT_SIZE, Exported, Network
from torch import Tensor, distributed, multiprocessing

from hypermap.perception.detectors.placement import BORDER, centered
from hypermap.simulation.network import CLASSES

IMAGE_SIZE = (320, 240)
_WARM_UP = 100  # steps
_EMA = 0.995  # of the averaged weights, per step


class Images:
    """All images with their objects, in memory."""

    def __init__(self, folder: Path) -> None:
        """Read what `render_images.py` saved."""
        files = sorted(folder.glob("[0-9]*[0-9].npz"))
        images, self.boxes, self.classes = [], [], []
        for file in files:
            with np.load(file) as data:
                images.append(data["images"])
                for i in range(len(data["images"])):
                    mine = data["image_ids"] == i
                    self.boxes.append(data["boxes"][mine])
                    self.classes.append(data["classes"][mine])
        self.images = np.concatenate(images)

    def __len__(self) -> int:
        """Return their number."""
        return len(self.images)

    def batch(self, chosen: np.ndarray, rng: np.random.Generator) -> tuple[Tensor, Tensor, Tensor]:
        """Return images as the network gets them, mirrored and colored by chance; see `Network`.

        Returns:
            Images, shape (B, 3, 256, 320); boxes, shape (B, M, 4); classes, shape (B, M).
        """
        count = max(1, *(len(self.boxes[i]) for i in chosen))
        placement = centered(IMAGE_SIZE, INPUT_SIZE)
        images = np.full((len(chosen), INPUT_SIZE[1], INPUT_SIZE[0], 3), BORDER / 255, np.float32)
        boxes = np.zeros((len(chosen), count, 4), np.float32)
        classes = np.full((len(chosen), count), -1)
        for k, i in enumerate(chosen):
            image, places = _colored(self.images[i], rng), self.boxes[i].copy()
            if rng.random() < 0.5:
                image, places[:, [0, 2]] = image[:, ::-1], IMAGE_SIZE[0] - places[:, [2, 0]]
            places += [placement.left, placement.top] * 2
            images[k, placement.top : placement.top + IMAGE_SIZE[1]] = image
            boxes[k, : len(places)], classes[k, : len(places)] = places, self.classes[i]
        return (
            torch.from_numpy(images).permute(0, 3, 1, 2),  # channels last in memory
            torch.from_numpy(boxes),
            torch.from_numpy(classes),
        )


def _colored(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return an image (0..1) in another light, with a little noise."""
    gain = rng.uniform(0.75, 1.25) * rng.uniform(0.9, 1.1, 3)
    offset = rng.uniform(-0.06, 0.06)
    table = np.arange(256)[:, np.newaxis] / 255
    table = np.clip(table ** rng.uniform(0.8, 1.25) * gain + offset, 0, 1).astype(np.float32)
    colored = np.stack([table[image[..., c], c] for c in range(3)], axis=-1)
    if rng.random() < 0.3:
        colored = colored + rng.normal(0, 0.01, image.shape[:2])[..., np.newaxis]
    return colored.astype(np.float32)


@dataclass(frozen=True)
class Plan:
    """How to train.

    Attributes:
        minutes: for how long; the learning rate falls to zero over this time.
        processes: that share the work, each with one thread: for so small a network, threads
            would wait for each other most of the time.
        batch_size: images per step and process.
        peak_rate: the highest learning rate.
        weights: a file to begin with if it is there, and to save in; None to begin again.
        seed: of all chance.
    """

    minutes: float
    processes: int
    batch_size: int
    peak_rate: float
    weights: Path | None = None
    seed: int = 0


def train(rank: int, plan: Plan, images: Images, output: Path) -> None:
    """Train in one of the processes; the first one saves the network, averaged over many steps."""
    os.environ |= {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": "29517"}
    distributed.init_process_group("gloo", rank=rank, world_size=plan.processes)
    torch.set_num_threads(1)
    torch.manual_seed(plan.seed)
    network = Network(len(CLASSES)).to(memory_format=torch.channels_last)
    if plan.weights and plan.weights.exists():
        network.load_state_dict(torch.load(plan.weights))
    average = copy.deepcopy(network).eval()
    optimizer = torch.optim.AdamW(network.parameters(), lr=plan.peak_rate, weight_decay=0.02)
    start, step, running = time.monotonic(), 0, 0.0
    for chosen, rng in _batches(len(images), rank, plan):
        share = _mean(torch.tensor([(time.monotonic() - start) / (60 * plan.minutes)])).item()
        if share >= 1:
            break
        for group in optimizer.param_groups:
            warm_up = min(1.0, (step + 1) / _WARM_UP)
            group["lr"] = plan.peak_rate * warm_up * (0.51 + 0.49 * math.cos(math.pi * share))
        pictures, boxes, classes = images.batch(chosen, rng)
        with torch.autocast("cpu", torch.bfloat16):
            sides, logits = network(pictures)
        loss = detection_loss(
            network.boxes(sides), logits, boxes, classes, network.points, network.strides
        )
        optimizer.zero_grad()
        loss.backward()
        _share_gradients(network)
        torch.nn.utils.clip_grad_norm_(network.parameters(), 10.0)
        optimizer.step()
        _average(average, network, min(_EMA, (step + 1) / (step + 20)))
        step += 1
        running += (loss.item() - running) / min(step, 50)
        if rank == 0 and step % 50 == 0:
            seen = step * plan.batch_size * plan.processes
            speed = seen / (time.monotonic() - start)
            print(
                f"{100 * share:3.0f} %, {seen / len(images):.2f} epochs, loss {running:.3f}, "
                f"{speed:.0f} images/s",
                flush=True,
            )
            if step % 200 == 0:
                save_onnx(copy.deepcopy(average), output)
    if rank == 0:
        save_onnx(average, output)
        if plan.weights:
            torch.save(average.state_dict(), plan.weights)
        seen = step * plan.batch_size * plan.processes / len(images)
        print(f"{output}: {output.stat().st_size / 1e6:.2f} MB after {seen:.1f} epochs")
    distributed.destroy_process_group()


def _batches(count: int, rank: int, plan: Plan) -> Iterator[tuple[np.ndarray, np.random.Generator]]:
    """Yield the numbers of the images of each step, and where its chance comes from."""
    order_rng = np.random.default_rng(plan.seed)
    rng = np.random.default_rng([plan.seed, rank])
    whole = plan.batch_size * plan.processes
    while True:
        order = order_rng.permutation(count)
        for start in range(rank * plan.batch_size, count - whole + plan.batch_size + 1, whole):
            yield order[start : start + plan.batch_size], rng


def _mean(values: Tensor) -> Tensor:
    """Return the mean over all processes."""
    distributed.all_reduce(values)
    return values / distributed.get_world_size()


def _share_gradients(network: Network) -> None:
    gradients = [p.grad for p in network.parameters() if p.grad is not None]
    mean = _mean(torch.cat([gradient.flatten() for gradient in gradients]))
    sizes = [gradient.numel() for gradient in gradients]
    for gradient, part in zip(gradients, mean.split(sizes), strict=True):
        gradient.copy_(part.view_as(gradient))


@torch.no_grad()
def _average(average: Network, network: Network, decay: float) -> None:
    for mean, now in zip(average.state_dict().values(), network.state_dict().values(), strict=True):
        if mean.dtype.is_floating_point:
            mean.lerp_(now, 1 - decay)
        else:
            mean.copy_(now)


def save_onnx(network: Network, path: Path) -> None:
    """Save a network with the names of its classes."""
    image = torch.zeros(1, 3, INPUT_SIZE[1], INPUT_SIZE[0])
    torch.onnx.export(
        Exported(network).eval(),
        (image,),
        str(path),
        input_names=["images"],
        output_names=["output0"],
        opset_version=18,
        dynamo=False,
    )
    model = onnx.load(path)
    onnx.helper.set_model_props(
        model,
        {
            "names": repr(dict(enumerate(CLASSES))),
            "imgsz": repr([INPUT_SIZE[1], INPUT_SIZE[0]]),
            "task": "detect",
            "description": "Hypermap's models of furniture, in rendered images",
        },
    )
    onnx.save(model, path)


def main() -> None:
    """Train, and save."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("images", type=Path, help="what render_images.py saved")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--minutes", type=float, default=15.0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--batch", type=int, default=16, help="images per step and process")
    parser.add_argument("--rate", type=float, default=2e-3, help="of learning, at its peak")
    parser.add_argument(
        "--weights", type=Path, help="to train on from there if it exists, and save"
    )
    arguments = parser.parse_args()
    plan = Plan(
        arguments.minutes,
        arguments.processes,
        arguments.batch,
        arguments.rate,
        arguments.weights,
    )
    images = Images(arguments.images)
    print(f"{len(images)} images")
    multiprocessing.start_processes(
        train, (plan, images, arguments.output), plan.processes, start_method="fork"
    )


if __name__ == "__main__":
    main()
