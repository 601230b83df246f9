"""A batch: its jobs are given to workers, and each result is saved as soon as it is there.

In the folder of results, `NAME.hmap` is the map of a job and `NAME.json` says what it was made of.
That is all it takes to resume a batch: a job whose map was made of the same is not done again.
"""

from __future__ import annotations

import contextlib
import json
import queue
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from hypermap.core.errors import HypermapError
from hypermap.fleet.batch.jobs import Job
from hypermap.fleet.batch.running import Done, run
from hypermap.fleet.workers import Workers
from hypermap.formats.atomic import write_file

_WAIT = 0.1  # s


@dataclass(frozen=True)
class Result:
    """What became of a job.

    Attributes:
        job: the job.
        state: "done", "unchanged" if its map was there already, "failed", or "not begun".
        figures: see `Done`; also those of a map that was there already.
        error: why it failed, or an empty text.
    """

    job: Job
    state: str
    figures: dict[str, Any]
    error: str = ""


def run_batch(
    jobs: Sequence[Job],
    folder: Path,
    workers: Workers,
    on_result: Callable[[Result], None] | None = None,
    is_stopped: Callable[[], bool] = lambda: False,
) -> list[Result]:
    """Do the jobs, and save their maps.

    A job that fails leaves the others alone.

    Args:
        jobs: what is to be done.
        folder: of the results; it is made if it is not there.
        workers: who does it.
        on_result: called for each job that ends, in the order in which they end.
        is_stopped: whether to end early, asked ten times a second; then jobs that have not ended
            are "not begun".

    Returns:
        The results in the order of the jobs.

    Raises:
        HypermapError: If a map cannot be saved.
    """
    folder.mkdir(parents=True, exist_ok=True)
    ended: queue.SimpleQueue[tuple[int, Future[Done]]] = queue.SimpleQueue()
    results = [Result(job, "not begun", {}) for job in jobs]
    futures = []
    for index, job in enumerate(jobs):
        future = workers.submit(run, job, _known(folder, job).get("key"), workers.threads)
        future.add_done_callback(partial(_put, ended, index))
        futures.append(future)
    open_jobs = len(jobs)
    while open_jobs and not is_stopped():
        try:
            index, future = ended.get(timeout=_WAIT)
        except queue.Empty:
            continue
        open_jobs -= 1
        results[index] = _result(jobs[index], future, folder)
        if on_result is not None:
            on_result(results[index])
    for future in futures:
        future.cancel()
    return results


def _put(ended: Any, index: int, future: Future[Done]) -> None:
    ended.put((index, future))


def _result(job: Job, future: Future[Done], folder: Path) -> Result:
    """Save what a job has made, and return what became of it."""
    try:
        done = future.result()
    except (HypermapError, OSError) as error:
        return Result(job, "failed", {}, str(error))
    except Exception as error:  # a bug, ours or a plug-in's: the other jobs go on
        return Result(job, "failed", {}, f"{type(error).__name__}: {error}")
    if done.content is None:
        return Result(job, "unchanged", _known(folder, job).get("figures", {}))
    # Remove the note of the old map first, so that it never belongs to another one.
    (folder / f"{job.name}.json").unlink(missing_ok=True)
    write_file(folder / f"{job.name}.hmap", done.content)
    note = {"key": done.key, "figures": done.figures}
    write_file(folder / f"{job.name}.json", json.dumps(note, indent=2).encode())
    return Result(job, "done", done.figures)


def _known(folder: Path, job: Job) -> dict[str, Any]:
    """Return the note of the map that is there; empty if there is none."""
    if not (folder / f"{job.name}.hmap").is_file():
        return {}
    with contextlib.suppress(OSError, ValueError, RecursionError):
        note = json.loads((folder / f"{job.name}.json").read_bytes())
        if isinstance(note, dict) and isinstance(note.get("figures"), dict):
            return note
    return {}
