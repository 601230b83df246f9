"""Opening, saving and asking with this version and another one, in turns.

    git worktree add --detach /tmp/other COMMIT
    python benchmarks/two_versions.py /tmp/other [--rounds N]

Each round runs both versions, each in a process of its own, on the same map: 5,000 objects and
1,000 x 1,000 cells. It prints the processor's time of each step, the least of all rounds, and the
median of the rounds' ratios, this version to the other; below 1 is faster.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
OBJECTS, SIDE = 5_000, 1_000

# What both versions can do; the first answers, which import what they need, do not count.
MEASURED = f"""
import json, sys, time
from pathlib import Path
import numpy as np
import shapely
from hypermap import Hypermap, OccupancyLayer, SemanticLayer, SemanticObject, open_map, save_map
from hypermap.core.grid import GridGeometry

draw = np.random.default_rng(0)
centers = draw.uniform(1, 99, ({OBJECTS}, 2))
turns = np.linspace(0, 2 * np.pi, 9)[:-1]
circle = np.column_stack([np.cos(turns), np.sin(turns)])
outlines = [shapely.Polygon(center + 0.4 * circle) for center in centers]
names = [f"thing {{number % 50}}" for number in range({OBJECTS})]
cells = draw.choice(np.array([-1, 0, 100], np.int8), ({SIDE}, {SIDE}))
points = draw.uniform(0, 100, (2_000, 2))
areas = [shapely.box(x, y, x + 3, y + 3) for x, y in points[:200]]
folder = Path(sys.argv[1])
took = {{}}


def made():
    things = [SemanticObject(name, outline) for name, outline in zip(names, outlines)]
    grid = OccupancyLayer("occupancy", "map", GridGeometry({SIDE}, {SIDE}, 0.1), cells)
    return Hypermap([grid, SemanticLayer("semantic", "map", things)])


def measure(what, work):
    work()
    times = []
    for _ in range(2):
        started = time.process_time()
        work()
        times.append(time.process_time() - started)
    took[what] = min(times)


def asked(hypermap, ask, values):
    for value in values:
        ask(hypermap, value)


measure("make", made)
hypermap, path = made(), folder / "map.hmap"
measure("save an archive", lambda: save_map(hypermap, path))
measure("save a folder", lambda: save_map(hypermap, folder / "map" / "hmap_config.yaml"))
measure("open an archive", lambda: open_map(path).semantic().objects())
opened = open_map(path)
measure("2,000 points", lambda: asked(opened, lambda m, p: m.label_at("semantic", p), points))
measure("200 areas", lambda: asked(opened, lambda m, a: m.labels_in("semantic", a), areas))
measure("50 names", lambda: asked(opened, lambda m, n: m.find("semantic", n), names[:50]))
print(json.dumps(took))
"""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("other", type=Path, help="a checkout of the other version")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    rounds = [(_took(HERE), _took(options.other.resolve())) for _ in range(options.rounds)]
    print(f"{'':20}{'this [s]':>10}{'other [s]':>10}{'ratio':>8}")
    for step in rounds[0][0]:
        ours, others = ([side[step] for side in sides] for sides in zip(*rounds, strict=True))
        ratio = statistics.median(a / b for a, b in zip(ours, others, strict=True))
        print(f"{step:20}{min(ours):10.4f}{min(others):10.4f}{ratio:8.2f}")


def _took(checkout: Path) -> dict[str, float]:
    """Return the processor's time of each step with the version of a checkout [s]."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "map").mkdir()
        environment = {**os.environ, "PYTHONPATH": str(checkout / "src")}
        command = [sys.executable, "-c", MEASURED, folder]
        ended = subprocess.run(command, env=environment, cwd=folder, stdout=-1, check=True)
    took: dict[str, float] = json.loads(ended.stdout)
    return took


if __name__ == "__main__":
    main()
