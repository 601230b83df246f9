"""Trains the detector for rendered images, and saves it as ONNX.

    python training/train_detector.py -o src/hypermap/simulation/detector.onnx --minutes 9

It needs PyTorch and onnx. Some processes render images of random worlds meanwhile, so that it never
sees many of them twice. `benchmarks/detector.py` measures what came out.
"""

from __future__ import annotations

import argparse
import copy
import math
import os
import time
from dataclasses import dataclass
from pathlib import Path

import onnx
import torch
from images import Images
from loss import detection_loss
from network import INPUT_SIZE, Exported, Network

from hypermap.simulation.network import CLASSES

_WARM_UP = 300  # steps
_EMA = 0.998  # of the averaged weights, per step
_REPORT_EVERY, _SAVE_EVERY = 10.0, 60.0  # seconds


@dataclass(frozen=True)
class Plan:
    """How to train.

    Attributes:
        output: where to save the network.
        minutes: for how long; the learning rate falls to zero over this time.
        device: what computes, as "cuda" or "cpu".
        batch_size: images per step.
        peak_rate: the highest learning rate.
        first: how many images there must be before it begins.
        weights: a file to begin with if it is there, and to save in; None to begin again.
    """

    output: Path
    minutes: float
    device: torch.device
    batch_size: int
    peak_rate: float
    first: int
    weights: Path | None = None


def train(plan: Plan, images: Images) -> None:
    """Train, and save the network, averaged over many steps, now and then and at the end."""
    torch.backends.cudnn.benchmark = True  # all batches have one shape
    start = reported = saved = time.monotonic()
    images.keep_on(plan.device)
    torch.manual_seed(0)
    network = Network(len(CLASSES)).to(plan.device, memory_format=torch.channels_last)
    if plan.weights and plan.weights.exists():
        network.load_state_dict(torch.load(plan.weights, map_location=plan.device))
    average = copy.deepcopy(network).eval()
    optimizer = torch.optim.AdamW(network.parameters(), lr=plan.peak_rate, weight_decay=0.02)
    while images.rendered < plan.first:
        time.sleep(0.1)
    print(f"first {images.rendered} images after {time.monotonic() - start:.0f} s", flush=True)
    step, running = 0, torch.zeros((), device=plan.device)
    while (share := (time.monotonic() - start) / (60 * plan.minutes)) < 1:
        for group in optimizer.param_groups:
            warm_up = min(1.0, (step + 1) / _WARM_UP)
            group["lr"] = plan.peak_rate * warm_up * (0.505 + 0.495 * math.cos(math.pi * share))
        loss = _step(network, optimizer, images.batch(plan.batch_size))
        _average(average, network, min(_EMA, (step + 1) / (step + 20)))
        step += 1
        running += (loss - running) / min(step, 100)
        now = time.monotonic()
        if now - reported > _REPORT_EVERY:
            reported = now
            speed = step * plan.batch_size / (now - start)
            print(
                f"{100 * share:3.0f} %, step {step}, loss {running.item():.3f}, "
                f"{speed:.0f} images/s of {images.rendered} rendered",
                flush=True,
            )
        if now - saved > _SAVE_EVERY:
            saved = now
            save(average, plan)
    images.end()
    save(average, plan)
    print(
        f"{plan.output}: {plan.output.stat().st_size / 1e6:.2f} MB after {step} steps of "
        f"{plan.batch_size} images, of {images.rendered} that were rendered"
    )


def _step(
    network: Network, optimizer: torch.optim.Optimizer, batch: tuple[torch.Tensor, ...]
) -> torch.Tensor:
    """Improve the network a little; return the loss."""
    pictures, boxes, classes = batch
    with torch.autocast(pictures.device.type, torch.bfloat16):
        sides, logits = network(pictures)
    loss = detection_loss(
        network.boxes(sides), logits, boxes, classes, network.points, network.strides
    )
    optimizer.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), 10.0)
    optimizer.step()
    return loss.detach()


@torch.no_grad()
def _average(average: Network, network: Network, decay: float) -> None:
    for mean, now in zip(average.state_dict().values(), network.state_dict().values(), strict=True):
        if mean.dtype.is_floating_point:
            mean.lerp_(now, 1 - decay)
        else:
            mean.copy_(now)


def save(network: Network, plan: Plan) -> None:
    """Save a network as ONNX, and its weights if asked."""
    network = copy.deepcopy(network).float().cpu()
    save_onnx(network, plan.output)
    if plan.weights:
        torch.save(network.state_dict(), plan.weights)


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
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--minutes", type=float, default=9.0)
    parser.add_argument(
        "--processes", type=int, default=os.cpu_count(), help="that render; by default one per core"
    )
    parser.add_argument(
        "--device", help="that trains, as cuda or cpu; by default a GPU if there is one"
    )
    parser.add_argument("--batch", type=int, default=256, help="images per step")
    parser.add_argument("--rate", type=float, default=3e-3, help="of learning, at its peak")
    parser.add_argument("--first", type=int, default=4000, help="images before the first step")
    parser.add_argument("--kept", type=int, default=30_000, help="images in memory, 0.23 MB each")
    parser.add_argument("--first-world", type=int, default=0, help="its number")
    parser.add_argument(
        "--weights", type=Path, help="to train on from there if it exists, and save"
    )
    arguments = parser.parse_args()
    images = Images(arguments.kept, arguments.processes, arguments.first_world)
    device = arguments.device or ("cuda" if torch.cuda.is_available() else "cpu")
    plan = Plan(
        arguments.output,
        arguments.minutes,
        torch.device(device),
        arguments.batch,
        arguments.rate,
        arguments.first,
        arguments.weights,
    )
    train(plan, images)


if __name__ == "__main__":
    main()
