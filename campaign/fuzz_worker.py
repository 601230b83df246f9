"""One process that fuzzes one target: guided by coverage where atheris is installed.

    python -m campaign.fuzz_worker TARGET[,TARGET...] SECONDS SEED FOLDER [RUNS|random]

Several targets are fuzzed one after the other, SECONDS each, each in FOLDER/TARGET and in a process
that begins with what all of them have imported.

SECONDS count from the start of that, but it asks at least once after it has warmed up. It keeps
what it finds in FOLDER, and says on standard output in one line of JSON what it did. What it is
asking at the moment lies in FOLDER/now, should it hang or die; FOLDER/ready is there once it has
warmed up, and FOLDER/died says why it could not. FOLDER/log has libFuzzer's lines, with the
coverage.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import importlib
import json
import logging
import os
import random
import re
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from campaign.fuzz_targets import TARGETS, target_of
from campaign.own_process import peak_bytes

MOST_SECONDS = 2.0  # of an answer, in time of the processor
MOST_BYTES = 1_000_000_000  # of memory, for the whole process
FRESH = 0.4  # the share of inputs that begin with an example, whatever was found since
READY, DIED = "ready", "died"  # files that say that a process has warmed up, or why not
LOG = "log"  # of libFuzzer
SPOILED = 0.6  # of the others, the share that we spoil by their kind; libFuzzer does the rest
_SOURCES = Path(__file__).resolve().parent.parent / "src"


Compare = Callable[[Any, Any, int, int, bool], Any]
"""How instrumented code compares: two values, an operator, a number, whether one is constant."""


class Tries:
    """Asks a target, and keeps what must not be.

    Attributes:
        runs: how often it asked.
        refused: how often the answer was a HypermapError.
        slowest: the longest answer [s], of the processor's time.
        prepared: how long it took until all was ready to be asked [s].
        processor: time of the processor since then, that of processes that ended included [s].
        findings: in words, with the file that shows each.
    """

    def __init__(self, ask: Callable[[bytes], object], folder: Path) -> None:
        self.runs = self.refused = 0
        self.slowest = self.prepared = self._begun = 0.0
        self.findings: dict[str, str] = {}
        self._ask = ask
        self._folder = folder
        self._now = (folder / "now").open("wb", buffering=0)
        self._is_warm = False
        self._is_large = False

    def __call__(self, data: bytes) -> None:
        """Ask once."""
        from hypermap import HypermapError

        os.ftruncate(self._now.fileno(), 0)
        os.pwrite(self._now.fileno(), data, 0)
        self.runs += 1
        started = time.process_time()
        try:
            self._ask(data)
        except HypermapError:
            self.refused += 1
        except MemoryError:
            self._keep("MemoryError", data)
        except Exception as error:
            self._keep(described(error), data)
        took = time.process_time() - started
        if self._is_warm:
            self.slowest = max(self.slowest, took)
            if took > MOST_SECONDS:
                self._keep(f"slow: {took:.1f} s", data, "slow")
        if not self._is_large:
            peak = peak_bytes()
            if peak > MOST_BYTES:
                self._is_large = True
                self._keep(f"memory: {peak / 1e6:.0f} MB", data, "memory")

    def warm_up(self, corpus: Sequence[bytes]) -> None:
        """Ask what is right, twice: it imports and compiles what the first answer needs."""
        for _ in range(2):
            for data in corpus:
                self(data)
        self._is_warm = True
        self._begun = _processor_seconds()
        (self._folder / READY).touch()

    @property
    def processor(self) -> float:
        """Return the time of the processor since all was ready [s]."""
        return _processor_seconds() - self._begun

    def close(self) -> None:
        """Ask no more."""
        self._now.close()

    def _keep(self, what: str, data: bytes, key: str | None = None) -> None:
        """Keep an input that shows something new; of slow and large ones, the first."""
        if (key or what) in self.findings:
            return
        path = self._folder / f"{hashlib.sha256(data).hexdigest()[:16]}.input"
        path.write_bytes(data)
        self.findings[key or what] = json.dumps({"what": what, "file": str(path)})


def _processor_seconds() -> float:
    return sum(os.times()[:4])


def described(error: BaseException) -> str:
    """Return what was raised and where, alike for all inputs that fall at the same place."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if frame.filename.startswith(str(_SOURCES))]
    last = (ours or frames)[-1]
    with contextlib.suppress(ValueError):
        place = Path(last.filename).relative_to(_SOURCES)
        return f"{type(error).__name__} in {place}:{last.lineno} ({last.name})"
    return f"{type(error).__name__} in {Path(last.filename).name}:{last.lineno} ({last.name})"


def main() -> None:
    """Fuzz targets, each until its time is over, and say what was found."""
    named, seconds, seed, folder, *runs = sys.argv[1:]
    names, kept = named.split(","), Path(folder).absolute()
    warnings.simplefilter("ignore")
    said = os.dup(1)  # what is asked writes on the others, and libFuzzer on the last
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    guide = _atheris() if not runs else None
    if len(names) == 1:
        _fuzz(names[0], float(seconds), int(seed), kept, runs, said, guide)
    _log_in(kept)
    with _instrumented(guide):
        for name in names:
            importlib.import_module(f"campaign.fuzz_targets.{TARGETS[name]}")
    for name in names:
        if (process := os.fork()) == 0:
            _fuzz(name, float(seconds), int(seed), kept / name, runs, said, guide)
        os.waitpid(process, 0)


def _fuzz(
    name: str, seconds: float, seed: int, kept: Path, runs: Sequence[str], said: int, guide: Any
) -> NoReturn:
    """Fuzz a target until its time is over, say what was found, and end the process."""
    started = time.monotonic()
    _log_in(kept)
    logging.getLogger().addHandler(logging.NullHandler())
    logging.lastResort = None
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None  # where saves need no disk
    with tempfile.TemporaryDirectory(prefix="hypermap-fuzz-", dir=memory) as scratch:
        os.chdir(scratch)
        with _instrumented(guide), _told(kept / DIED):
            target = target_of(name, Path(scratch))
            tries = Tries(target.ask, kept)
            tries.warm_up(target.corpus)  # which imports what the program imports when it needs it
            tries.prepared = time.monotonic() - started
        arguments = tries, target, started + seconds, seed
        if guide is not None:
            _guided(guide, *arguments, kept, partial(_end, said, target, name, tries, scratch))
        _at_random(*arguments, int(runs[0]) if runs and runs[0] != "random" else None)
        _say(said, name, tries, "random")
        target.close()
    os._exit(0)  # threads of servers do not hold us up


def _log_in(folder: Path) -> None:
    """Let what is written to standard error go to a file of a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    os.dup2(os.open(folder / LOG, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND), 2)


@contextlib.contextmanager
def _told(file: Path) -> Iterator[None]:
    """Write into a file why a target cannot be prepared: nobody reads what is printed."""
    try:
        yield
    except BaseException:
        file.write_text(traceback.format_exc(), encoding="utf-8")
        raise


def _say(handle: int, name: str, tries: Tries, way: str) -> None:
    reported = {
        "target": name,
        "way": way,
        "runs": tries.runs,
        "refused": tries.refused,
        "slowest": tries.slowest,
        "prepared": tries.prepared,
        "processor": tries.processor,
        "peak": peak_bytes(),
        "findings": [json.loads(found) for found in tries.findings.values()],
    }
    os.write(handle, json.dumps(reported).encode() + b"\n")


def _end(handle: int, target: Any, name: str, tries: Tries, scratch: str) -> None:
    """Say what was done, and end: libFuzzer does not return."""
    _say(handle, name, tries, "coverage")
    target.close()
    shutil.rmtree(scratch, ignore_errors=True)
    os._exit(0)


def _at_random(tries: Tries, target: Any, ends: float, seed: int, runs: int | None = None) -> None:
    """Spoil examples without a guide: until a time, or so many of them."""
    draw = random.Random(seed)
    corpus, known = list(target.corpus), tries.runs
    while (tries.runs < runs + known) if runs is not None else (time.monotonic() < ends):
        data = spoiled(draw.choice(corpus), target, corpus, draw)
        before = tries.refused
        tries(data)
        if tries.refused == before and len(corpus) < 200:
            corpus.append(data)  # what still opens may be spoiled further


def spoiled(data: bytes, target: Any, corpus: Sequence[bytes], draw: random.Random) -> bytes:
    """Return an input made of an example, or of two."""
    from campaign.mutation import crossed

    if draw.random() < 0.05:
        data = crossed(data, corpus, draw)
    for _ in range(draw.choice([1, 1, 1, 2, 3])):
        data = target.mutate(data, draw)
    return data


def _guided(
    guide: Any,
    tries: Tries,
    target: Any,
    ends: float,
    seed: int,
    kept: Path,
    end: Callable[[], None],
) -> None:
    """Let libFuzzer choose what is spoiled further: what reaches new lines."""
    from campaign.mutation import MOST_BYTES as LONGEST

    corpus = kept / "corpus"
    corpus.mkdir(exist_ok=True)
    for number, data in enumerate(target.corpus):
        (corpus / f"example-{number}").write_bytes(data)

    mended: Compare | None = None

    def once(data: bytes) -> None:
        nonlocal mended
        if mended is None:  # Fuzz has put another there
            mended = guide._trace_cmp = without_leak(guide._trace_cmp)
        tries(data)
        if time.monotonic() > ends:
            end()

    def mutate(data: bytes, most: int, number: int) -> bytes:
        draw = random.Random(number)
        if draw.random() < FRESH:
            data = draw.choice(target.corpus)
        elif draw.random() > SPOILED:
            return bytes(guide.Mutate(data, most))
        return spoiled(data, target, target.corpus, draw)[:most]

    options = [f"-seed={seed % 2**31 or 1}", "-rss_limit_mb=0", "-timeout=600", "-handle_int=0"]
    options += [f"-max_len={LONGEST}", "-close_fd_mask=2", "-len_control=0"]
    guide.Setup([sys.argv[0], *options, str(corpus)], once, custom_mutator=mutate)
    guide.Fuzz()


def _atheris() -> Any:
    """Return the guide, or None where it is not installed."""
    try:
        import atheris
    except ImportError:
        return None
    return atheris


def without_leak(compare: Compare) -> Compare:
    """Return how instrumented code compares, without the reference that atheris 3.0.0 leaks.

    It never frees what a comparison gives, which matters where that is an array: a process that
    maps grew by 0.1 to 0.3 MB with each input.
    """
    import numpy as np

    one = np.zeros(1)
    leaks = sys.getrefcount(compare(one, one, 2, 0, False)) > sys.getrefcount(one == one)
    release = ctypes.pythonapi.Py_DecRef
    release.argtypes = [ctypes.py_object]

    def compared(left: Any, right: Any, operator: int, counter: int, is_constant: bool) -> Any:
        found = compare(left, right, operator, counter, is_constant)
        if type(found) is np.ndarray:
            release(found)
        return found

    return compared if leaks else compare


def _instrumented(guide: Any) -> contextlib.AbstractContextManager[Any]:
    """Return a context in which what is imported tells the guide what it reaches."""
    if guide is None:
        return contextlib.nullcontext()
    packages = ["hypermap", "rosbags", "yaml"]
    made: contextlib.AbstractContextManager[Any] = guide.instrument_imports(packages, _with_loops())
    return made


def _with_loops() -> list[str]:
    """Return the modules with compiled loops, which numba must find as they are written."""
    found = [
        ".".join(path.relative_to(_SOURCES).with_suffix("").parts)
        for path in sorted(_SOURCES.rglob("*.py"))
        if re.search(r"^@(inner_)?loop\(", path.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    return [*found, "hypermap._loops"]


if __name__ == "__main__":
    main()
