"""What the second reader of semantic YAML gives: how long files of some sizes take to be read.

Prints seconds of processor time, medians of runs in turns: by the reader of the regular form, by
the reader of all YAML alone, and as GeoParquet.

    python benchmarks/yaml_readers.py [--repeat 3]
"""

from __future__ import annotations

import argparse
import statistics
import time
from typing import Any

from suite.objects import floor

from hypermap.formats.semantic.parquet_files import dump_parquet
from hypermap.formats.semantic.yaml_files import dump_table, parse_content, parse_objects
from hypermap.testing import assert_same_objects

SIZES = (100, 1000, 10_000, 100_000)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=3)
    repeat = parser.parse_args().repeat
    print("| objects | YAML [MB] | regular form [s] | all YAML [s] | GeoParquet [s] |")
    print("| ---: | ---: | ---: | ---: | ---: |")
    for count in SIZES:
        table = floor(count, points=1).layer().table
        text, binary = dump_table(table), dump_parquet(table, "map")
        readers = {"regular": parse_content, "all": parse_objects, "binary": parse_content}
        seconds: dict[str, list[float]] = {name: [] for name in readers}
        held: dict[str, Any] = {}
        for _ in range(repeat):
            for name, read in readers.items():
                start = time.process_time()
                objects, _rejected = read(binary if name == "binary" else text, "objects")
                seconds[name].append(time.process_time() - start)
                held[name] = objects
        some = range(0, count, max(1, count // 100))
        by_columns = [held["regular"].object(row) for row in some]
        assert_same_objects(by_columns, [held["all"][row] for row in some])
        medians = " | ".join(f"{statistics.median(runs):.3g}" for runs in seconds.values())
        print(f"| {count:,} | {len(text) / 1e6:.2g} | {medians} |", flush=True)


if __name__ == "__main__":
    main()
