"""Kill: whatever happens to a save, the old or the new is there, whole, and nothing strays.

Each way to save is cut off at each of its operations on files: killed there, with a broken disk, by
others who remove files, at so many bytes of a full disk; and killed at random times.
"""

from __future__ import annotations

import itertools
import os
import random
import re
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from campaign.faults import (
    Fault,
    Operations,
    Outcome,
    fresh,
    full_disk,
    import_what_it_needs,
    in_a_process,
    read_only,
)
from campaign.part import Budget, Finding, Result
from campaign.way import Way
from campaign.ways_of_full_maps import write_full_sources
from campaign.ways_to_save import ways, write_sources

FAULTS: tuple[Fault, ...] = ("kill", "EIO", "vanish", "sweep")
RANDOM_KILLS = 300
_DISK_SIZES = (0, 1, 100, 1000, 4000)  # bytes
_TAKES = ("vanish", "sweep")  # faults that take files away
_OLDER = b"an older backup"
NOTHING: frozenset[str] = frozenset()
_SHORT = ("archive", "folder", "the page")
_SHORT_STEP = 7  # of the operations, in the short form, one in so many


@dataclass
class Trial:
    """A way to save, and what it leaves when nothing happens to it.

    Attributes:
        way: the way.
        place: a folder of its own.
        versions: what `read` says of the old and of the new.
        names: of the files that are there after both were saved.
        operations: how many the second save does.
    """

    way: Way
    place: Path
    versions: tuple[str, str] = ("", "")
    names: frozenset[str] = frozenset()
    operations: int = 0

    @property
    def folder(self) -> Path:
        """Where it saves."""
        return self.place / "now"

    def prepare(self) -> None:
        """Save the old, then the new, with nobody in the way."""
        fresh(self.folder)
        import_what_it_needs(partial(_save_and_read, self.way, self.folder, 0))
        old = in_a_process(partial(_save_and_read, self.way, self.folder, 0))
        fresh(self.place / "old", self.folder)
        counting = partial(Operations, self.folder)
        saved = in_a_process(partial(self.way.save, self.folder, 1), counting)
        new = in_a_process(partial(self.way.read, self.folder))
        for outcome in (old, saved, new):
            if outcome.error or outcome.signal:
                raise RuntimeError(f"{self.way.name}: {outcome}")
        for backup in self.folder.glob("*.bak*"):
            if backup.is_file() and not (older := self.place / "old" / backup.name).exists():
                older.write_bytes(_OLDER)
        self.versions = old.value, new.value
        assert old.value != new.value, f"{self.way.name}: both versions look alike"
        self.names, self.operations = _names(self.folder), saved.operations

    def again(self) -> None:
        """Put the old there."""
        fresh(self.folder, self.place / "old")

    def _lost(self) -> list[str]:
        """Return the names of older backups that are not as they were."""
        return [
            older.name
            for older in (self.place / "old").glob("*.bak*")
            if older.is_file() and (self.folder / older.name).read_bytes() != older.read_bytes()
        ]

    def check(self, outcome: Outcome, fault: str = "", links: frozenset[str] = NOTHING) -> str:
        """Return what is wrong after a save to which something happened; empty if nothing is."""
        is_done = not outcome.signal and not outcome.error
        if outcome.fall:
            return outcome.fall
        found = in_a_process(partial(self.way.read, self.folder))
        # What others have removed is gone: both what was there, and parts of what was to come.
        is_torn = fault == "vanish" or (fault == "sweep" and not is_done)
        if found.signal or (found.error and not (is_torn and found.is_ours)):
            return f"cannot be read: {found.error or found.signal}"
        if not found.error and not is_torn and found.value not in self.versions:
            return "is neither the old nor the new"
        if is_done and not found.error and found.value != self.versions[1]:
            return "is not the new, though it was said to be saved"
        has_failed = outcome.error and fault not in _TAKES and found.value == self.versions[0]
        if has_failed and (lost := self._lost()):
            return f"replaced {', '.join(lost)}, though it failed"
        then = in_a_process(partial(_save_and_read, self.way, self.folder, 1))
        if then.error or then.value != self.versions[1]:
            return f"cannot be saved again: {then.error or 'another version is there'}"
        if strays := _names(self.folder) - self.names - links:
            return f"leaves {', '.join(sorted(strays))} behind"
        return ""


def kill_at_operations(trial: Trial) -> list[str]:
    """Return what is wrong after a way to save was killed at each of its operations."""
    problems = []
    for number in range(trial.operations):
        trial.again()
        prepare = partial(Operations, trial.folder, number)
        outcome = in_a_process(partial(trial.way.save, trial.folder, 1), prepare)
        if problem := trial.check(outcome):
            problems.append(problem)
    return problems


def run(budget: Budget) -> Result:
    """Do all of it, as far as the time lasts; the short form takes a sample of fixed size."""
    return _Campaign(budget).run()


class _Campaign:
    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._draw = random.Random(budget.seed)
        self._next = budget
        self._runs = self._ways = 0
        self._left_out: Counter[str] = Counter()
        self._slowest = (0.0, "")
        self._found: dict[str, Finding] = {}
        self._figures: dict[str, float | str] = {}

    def run(self) -> Result:
        # Where no disk is waited for, if there is such a place.
        memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
        with tempfile.TemporaryDirectory(prefix="hypermap-kill-", dir=memory) as work:
            Path(work).chmod(0o755)  # for the one who may only read
            return self._run(Path(work))

    def _run(self, root: Path) -> Result:
        write_sources(root / "sources")
        if not self._budget.short:
            made = in_a_process(partial(write_full_sources, root / "sources"))
            assert not made.error, made
        trials = list(self._prepared(root))
        self._ways = max(1, len(trials))
        operations = sum(trial.operations for trial in trials)
        self._figures["ways to save"] = len(trials)
        self._figures["operations on files"] = operations
        kinds: list[tuple[str, Callable[[Trial], None]]] = [
            ("killed at an operation", partial(self._at_operations, "kill")),
            ("disk broken at an operation", partial(self._at_operations, "EIO")),
            ("files vanished at an operation", partial(self._at_operations, "vanish")),
            ("temporaries vanished at an operation", partial(self._at_operations, "sweep")),
            ("disk full", partial(self._on_a_full_disk, False)),
            ("killed within a write", partial(self._on_a_full_disk, True)),
            ("read-only", self._read_only),
            ("through links", self._through_links),
            ("killed at a random time", self._at_random_times),
        ]
        for done, (kind, work) in enumerate(kinds):
            before, of_kind = self._runs, self._budget.share(len(kinds) - done)
            for number, trial in enumerate(trials):
                if of_kind.is_over:
                    self._left_out[kind] += 1
                    continue
                self._next = of_kind.share(len(trials) - number)
                work(trial)
            self._figures[kind] = self._runs - before
        self._figures["slowest"] = f"{self._slowest[0]:.2f} s ({self._slowest[1]})"
        left_out = [f"{count} ways {what}" for what, count in self._left_out.items()]
        return Result("kill", self._runs, list(self._found.values()), self._figures, left_out)

    def _prepared(self, root: Path) -> Iterator[Trial]:
        """Yield the trials that are ready, in any order, until half of the time is over."""
        chosen = [way for way in ways() if not self._budget.short or way.name in _SHORT]
        half = self._budget.share(2)
        for number, way in enumerate(self._draw.sample(chosen, len(chosen))):
            if half.is_over:
                self._left_out["that were not prepared"] += 1
                continue
            place = root / f"way-{number}"
            place.mkdir()
            (place / "sources").symlink_to(root / "sources")
            trial = Trial(way, place)
            if self._is_ready(trial):
                yield trial

    def _is_ready(self, trial: Trial) -> bool:
        """Prepare a trial; that a way cannot even save in peace is a finding, and others go on."""
        try:
            trial.prepare()
        except RuntimeError as error:
            self._found[trial.way.name] = Finding(str(error), self._budget.seed)
            return False
        return True

    def _steps(self, count: int) -> Iterator[int]:
        """Yield the operations to fail at, in any order; where time is short, fewer of them."""
        if self._budget.short:
            yield from range(self._draw.randrange(_SHORT_STEP), count, _SHORT_STEP)
            return
        for done, number in enumerate(self._draw.sample(range(count), count)):
            if done and self._next.is_over:
                return
            yield number

    def _try(
        self,
        trial: Trial,
        what: str,
        prepare: Callable[[], Any],
        fault: str = "",
        links: frozenset[str] = NOTHING,
    ) -> None:
        started = time.monotonic()
        outcome = in_a_process(partial(trial.way.save, trial.folder, 1), prepare)
        problem = trial.check(outcome, fault, links)
        self._runs += 1
        self._slowest = max(self._slowest, (time.monotonic() - started, trial.way.name))
        if problem:
            text = f"{trial.way.name}, {what}: {problem}"
            self._found.setdefault(
                re.sub(r"[0-9a-f]{16}|\d+", "", f"{trial.way.name} {what} {problem}"),
                Finding(text, self._budget.seed),
            )

    def _at_operations(self, fault: Fault, trial: Trial) -> None:
        for number in self._steps(trial.operations):
            trial.again()
            prepare = partial(Operations, trial.folder, number, fault)
            self._try(trial, f"{fault} at operation {number}", prepare, fault)

    def _on_a_full_disk(self, kills: bool, trial: Trial) -> None:
        for size in _DISK_SIZES[1::3] if self._budget.short else _DISK_SIZES:
            trial.again()
            what = f"{'killed' if kills else 'disk full'} at {size} bytes of a file"
            self._try(trial, what, partial(full_disk, size, kills=kills))
            if self._budget.is_over:
                return

    def _read_only(self, trial: Trial) -> None:
        trial.again()
        made, elsewhere = trial.folder, trial.place / "elsewhere"
        fresh(elsewhere, trial.place / "old")
        outcome = in_a_process(
            partial(trial.way.save, made, 1), partial(_be_a_reader, made, trial.way, elsewhere)
        )
        self._runs += 1
        problem = ""
        if not outcome.error:
            problem = "was saved where nobody may write"
        elif not outcome.is_ours:
            problem = f"raised {outcome.error}"
        for path in [made, *made.rglob("*")]:
            path.chmod(0o755 if path.is_dir() else 0o644)
        if not problem:
            problem = trial.check(Outcome(error="refused", is_ours=True))
        if problem:
            self._found[f"{trial.way.name}, read-only"] = Finding(
                f"{trial.way.name}, in a read-only folder: {problem}", self._budget.seed
            )

    def _through_links(self, trial: Trial) -> None:
        """Save over links to files of a folder below: the links stay, what they name changes."""
        for number in itertools.chain([None], self._steps(trial.operations)):
            trial.again()
            there = trial.folder / "there"
            there.mkdir()
            linked = [path for path in trial.folder.iterdir() if path.is_file()]
            for path in linked:
                path.rename(there / path.name)
                path.symlink_to(Path("there") / path.name)
            links = frozenset(["there", *(f"there/{path.name}" for path in linked)])
            prepare = partial(Operations, trial.folder, number)
            self._try(trial, f"through links, killed at {number}", prepare, links=links)
            if lost := [path.name for path in linked if not path.is_symlink()]:
                text = f"{trial.way.name}: {', '.join(lost)} are no links any more"
                self._found.setdefault(f"{trial.way.name} links", Finding(text, self._budget.seed))
            if self._budget.short:
                break

    def _at_random_times(self, trial: Trial) -> None:
        count = 3 if self._budget.short else RANDOM_KILLS // self._ways + 1
        trial.again()
        started = time.monotonic()
        in_a_process(partial(trial.way.save, trial.folder, 1))
        usual = time.monotonic() - started
        for _ in range(count):
            trial.again()
            patience = self._draw.uniform(0.0, 1.2 * usual)
            what = "killed at a random time"
            self._try(trial, what, partial(die_after, patience))
            if self._budget.is_over:
                return


def die_after(seconds: float) -> None:
    """Be killed by another process after a while."""
    victim = os.getpid()
    if os.fork() == 0:
        time.sleep(seconds)
        os.kill(victim, signal.SIGKILL)
        os._exit(0)


def _be_a_reader(folder: Path, way: Way, elsewhere: Path) -> None:
    """Become who may read a folder and not write there."""
    way.save(elsewhere, 1)  # imports what it needs, from where the reader may not look
    read_only(folder)


def _save_and_read(way: Way, folder: Path, version: int) -> str:
    way.save(folder, version)
    return way.read(folder)


def _names(folder: Path) -> frozenset[str]:
    return frozenset(str(path.relative_to(folder)) for path in folder.rglob("*"))
