"""Store: what robots and people put into a store arrives whole and once, whoever dies meanwhile.

- The spool, in which observations wait for a store: each operation on the disk below SQLite fails,
  once or for good, or is where the process is killed.
- Pushes of maps to PostgreSQL: the client is killed at random times, its connection cut, and the
  server ended as by a loss of power.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import itertools
import random
import shutil
import tempfile
import threading
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from campaign.faults import in_a_process
from campaign.full_map import full_map
from campaign.part import Budget, Finding, Result, merged
from campaign.sqlite_faults import DiskFault, FailingDisk, is_reachable
from hypermap import HypermapError, save_map
from hypermap.core.hypermap import Hypermap
from hypermap.formats.config import CONFIG_NAME
from hypermap.formats.hmap import files_of_map
from hypermap.testing import square

if TYPE_CHECKING:
    from hypermap.fleet.store.observed import Observed
    from hypermap.testing.postgres import PrivateServer

_SHORT_STEP = 9  # of the operations, in the short form, one in so many
_SITE = "office"


def run(budget: Budget) -> Result:
    """Try both, as far as what they need is installed."""
    if importlib.util.find_spec("psycopg") is None:
        return Result("store", 0, figures={"left out": "psycopg is missing"})
    return merged("store", [_spools(budget.share(2)), _pushes(budget)])


# The spool

PUT, REMOVED = "put", "removed"


@dataclass(frozen=True)
class Told:
    """What a robot was told of its observations, by their ids, in order.

    Attributes:
        before: those that waited in the spool before.
        done: "put" or "removed", and the id, where the spool said that it was done.
        refused: those that the spool refused at least once.
        problem: what should not have been raised; empty if nothing was.
    """

    before: list[str]
    done: list[tuple[str, str]]
    refused: set[str]
    problem: str = ""


def spool_problem(folder: Path, at: int | None, fault: DiskFault = "once") -> tuple[str, int]:
    """Use a spool whose disk fails at an operation.

    Args:
        folder: to work in; it is emptied.
        at: number of the operation; None for none of them.
        fault: what happens there.

    Returns:
        What is wrong afterwards, empty if nothing is; and how many operations there were.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    before = [_observed(number) for number in range(2)]
    outcome = in_a_process(partial(_fill, folder / "spool", before))
    assert not outcome.error, outcome
    told = folder / "told"
    outcome = in_a_process(partial(_use, folder / "spool", told), partial(FailingDisk, at, fault))
    if outcome.error or outcome.fall:
        return outcome.fall or outcome.error, outcome.operations
    heard = _read_told(told, [str(each.id) for each in before])
    if heard.problem:
        return heard.problem, outcome.operations
    waits = in_a_process(partial(_drain, folder / "spool"))
    if waits.error:
        return f"cannot be read afterwards: {waits.error}", outcome.operations
    return _lost_or_doubled(heard, waits.value), outcome.operations


def _lost_or_doubled(told: Told, waits: list[str]) -> str:
    """Return what is wrong with what waits in a spool after all."""
    put = [*told.before, *(each for what, each in told.done if what == PUT)]
    removed = {each for what, each in told.done if what == REMOVED}
    if lost := [each for each in put if each not in removed and each not in waits]:
        # The store has what was to be removed, so it may be gone without an answer.
        lost = [each for each in lost if each != told.before[0]]
        if lost:
            return f"{len(lost)} of {len(put)} observations are lost"
    if back := removed & set(waits):
        return f"{len(back)} that were removed are there again"
    if twice := [each for each in set(waits) if waits.count(each) > 1 and each not in told.refused]:
        return f"{len(twice)} are there twice"
    known = [each for each in put if each in waits]
    if sorted(known, key=waits.index) != known:
        return "they are in another order"
    return ""


def _observed(number: int) -> Observed:
    from hypermap.fleet.store.observed import Observed

    return Observed(_SITE, "semantic", "anna", [square("cup", number, 0, id=number)])


def _fill(path: Path, observed: list[Observed]) -> None:
    from hypermap.fleet.store.spool import Spool

    with contextlib.closing(Spool(path)) as spool:
        for each in observed:
            spool.put(each)


def _use(path: Path, told: Path) -> None:
    """Put, send and remove as `LiveWriter` does, which tries again what was refused."""
    from hypermap.fleet.store.spool import Spool

    with told.open("wb", buffering=0) as out:

        def tell(what: str, text: object) -> None:
            out.write(f"{what} {text}\n".encode())

        def tries(work: Callable[[], object], what: str, observed: object) -> bool:
            try:
                work()
            except HypermapError as error:
                tell("refused", observed)
                if str(path) not in str(error):
                    tell("problem", f"the message does not name the file: {error}")
                return False
            tell(what, observed)
            return True

        try:
            spool = Spool(path)
        except HypermapError:
            return  # the robot is told at once
        first: Any = None
        with contextlib.closing(spool):
            one, other = _observed(2), _observed(3)
            is_put = tries(lambda: spool.put(one), PUT, one.id)
            with contextlib.suppress(HypermapError):
                first = spool.first()
            if first is not None:
                tries(lambda: spool.remove(first[0]), REMOVED, first[1].id)
            if not is_put:
                tries(lambda: spool.put(one), PUT, one.id)
            tries(lambda: spool.put(other), PUT, other.id)


def _read_told(path: Path, before: list[str]) -> Told:
    lines = [line.split(" ", 1) for line in path.read_text().splitlines()]
    return Told(
        before,
        [(what, text) for what, text in lines if what in (PUT, REMOVED)],
        {text for what, text in lines if what == "refused"},
        next((text for what, text in lines if what == "problem"), ""),
    )


def _drain(path: Path) -> list[str]:
    """Return the ids of all that waits."""
    from hypermap.fleet.store.spool import Spool

    found = []
    with contextlib.closing(Spool(path)) as spool:
        while (first := spool.first()) is not None:
            found.append(str(first[1].id))
            spool.remove(first[0])
    return found


def _spools(budget: Budget) -> Result:
    """Let the disk fail at each operation, in any order; where time is short, at fewer of them."""
    if not is_reachable():
        return Result("store", 0, figures={"spool": "left out: Python's SQLite is built in"})
    findings: dict[str, Finding] = {}
    runs = 0
    with tempfile.TemporaryDirectory(prefix="hypermap-spool-") as work:
        import_ahead()
        problem, count = spool_problem(Path(work) / "spool", None)
        assert not problem, problem
        cases = [(at, fault) for at in range(count) for fault in get_args(DiskFault)]
        random.Random(budget.seed).shuffle(cases)
        for at, fault in cases[::_SHORT_STEP] if budget.short else cases:
            if budget.is_over:
                break
            problem, _ = spool_problem(Path(work) / "spool", at, fault)
            runs += 1
            if problem:
                text = f"spool, disk fails {fault} at operation {at} of {count}: {problem}"
                findings.setdefault(f"{fault} {problem}", Finding(text, budget.seed))
    figures: dict[str, float | str] = {"operations below the spool": count, "faults there": runs}
    missed = 0 if budget.short else len(cases) - runs
    left_out = [f"{missed} of {len(cases)} faults below the spool"] if missed else []
    return Result("store", runs, list(findings.values()), figures, left_out)


def import_ahead() -> None:
    """Import what processes that are forked later need."""
    for name in ("fleet.store.spool", "fleet.store.pushing", "cli.main", "cli.push"):
        importlib.import_module(f"hypermap.{name}")


# Pushes

_CUTS = ("client killed", "connection cut", "power lost")


def _pushes(budget: Budget) -> Result:
    from hypermap.testing.postgres import private_server, why_no_server

    if (reason := why_no_server()) is not None:
        return Result("store", 0, figures={"pushes": f"left out: {reason}"})
    findings: dict[str, Finding] = {}
    counts = dict.fromkeys(_CUTS, 0)
    draw = random.Random(budget.seed)
    with (
        private_server("-c shared_buffers=32MB") as server,
        tempfile.TemporaryDirectory(prefix="hypermap-push-") as work,
    ):
        pushed = PushedMap(server, Path(work))
        for done in itertools.count():
            if done >= len(_CUTS) if budget.short else budget.is_over:
                break
            cut = _CUTS[done % len(_CUTS)]
            problem = pushed.problem_after(cut, draw.uniform(0.0, 1.1))
            counts[cut] += 1
            if problem:
                text = f"push, {cut}: {problem}"
                findings.setdefault(text, Finding(text, budget.seed))
        figures: dict[str, float | str] = {f"pushes, {cut}": counts[cut] for cut in _CUTS}
        figures["pushes that were done all the same"] = pushed.done
    left_out = [f"pushes, {cut}" for cut in _CUTS if not counts[cut]]
    return Result("store", sum(counts.values()), list(findings.values()), figures, left_out)


class PushedMap:
    """A site of a store, and two versions of a map that are pushed to it in turn.

    Attributes:
        done: how many pushes that were cut off had been done before.
    """

    def __init__(self, server: PrivateServer, folder: Path) -> None:
        """Make the store and push the first version."""
        import psycopg

        from hypermap.fleet.store.address import parse_address
        from hypermap.fleet.store.migrating import migrate

        self._server = server
        with psycopg.connect(server.address("postgres"), autocommit=True) as connection:
            connection.execute("CREATE DATABASE store")
        self._address = parse_address(server.address("store"))
        migrate(self._address)
        self._files = [folder / f"{version}.hmap" for version in (0, 1)]
        for version, path in enumerate(self._files):
            made = full_map(version)
            made.history = None
            made.metadata["id"] = str(uuid.UUID(int=7))  # both are one map
            save_map(made, path)
        self._now, self.done = 1, 0
        self._expected: list[str] = []
        took: list[float] = []
        for version in (0, 1, 0, 1):
            started = time.monotonic()
            pushed = in_a_process(partial(self._push, version, is_new=not took))
            assert not pushed.error, pushed
            took.append(time.monotonic() - started)
            self._expected.append(self._pulled())
        self._usual = min(took)
        assert self._expected[:2] == self._expected[2:], "the same is stored in two ways"
        assert self._expected[0] != self._expected[1], "both versions look alike"

    def problem_after(self, cut: str, share: float) -> str:
        """Push the other version, and be cut off after a share of the usual time.

        Returns:
            What is wrong afterwards; empty if nothing is.
        """
        before, after = self._now, 1 - self._now
        at = share * self._usual
        thread = threading.Timer(at, self._cut, (cut,))
        if cut != "client killed":
            thread.start()
        killed_after = at if cut == "client killed" else None
        outcome = in_a_process(partial(self._push, after), partial(_die_after, killed_after))
        if cut != "client killed":
            thread.join()
        if outcome.fall:
            return outcome.fall
        found = self._pulled()
        if found not in self._expected:
            return "the site holds neither the old nor the new"
        is_done = not outcome.error and not outcome.signal
        if is_done and found != self._expected[after]:
            return "the site holds the old, though it was said to be pushed"
        self.done += found != self._expected[before]
        again = in_a_process(partial(self._push, after))
        if again.error or self._pulled() != self._expected[after]:
            return f"it cannot be pushed again: {again.error or 'another version is there'}"
        self._now = after
        return ""

    def _cut(self, cut: str) -> None:
        if cut == "power lost":
            self._server.stop()
            self._server.start()
            return
        import psycopg

        with psycopg.connect(self._server.address("postgres"), autocommit=True) as connection:
            connection.execute(
                "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = 'store'"
            )

    def _push(self, version: int, *, is_new: bool = False) -> None:
        from hypermap.cli.main import main

        words = ["push", str(self._files[version]), self._server.address("store")]
        words += ["--site", _SITE, *([] if is_new else ["--update"])]
        try:
            main(words)
        except SystemExit as ended:
            if ended.code:
                raise HypermapError("the command said what was wrong") from None

    def _pulled(self) -> str:
        from hypermap.fleet.store.database import Database
        from hypermap.fleet.store.pushing import pull

        database = Database(self._address)
        try:
            return self._content(pull(database, _SITE))
        finally:
            database.close()

    @staticmethod
    def _content(hypermap: Hypermap) -> str:
        """Return all that a store keeps of a map as a short text, but for when it was pushed."""
        files = files_of_map(hypermap)
        kept = (name for name in sorted(files) if name != CONFIG_NAME and "history" not in name)
        parts = [name.encode() + files[name] for name in kept]
        return hashlib.sha256(b"|".join(parts)).hexdigest()[:16]


def _die_after(seconds: float | None) -> None:
    if seconds is not None:
        from campaign.kill import die_after

        die_after(seconds)
