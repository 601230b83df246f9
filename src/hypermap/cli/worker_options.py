"""Options that say which workers do the work, and the workers."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from hypermap.fleet.workers import Workers

MOST_WORKERS = 256  # a computer has no more cores

Address = Annotated[
    str | None,
    typer.Option(
        "--address",
        metavar="ADDRESS",
        show_default=False,
        help="Work on a Ray cluster: HOST:PORT, ray://HOST:PORT, auto, or local to start one here.",
    ),
]


@contextlib.contextmanager
def opened_workers(count: int | None, address: str | None, most: int) -> Iterator[Workers]:
    """Yield workers: processes of this computer, or of a Ray cluster if there is an address.

    Args:
        count: how many; None for one per core of the computer or the cluster.
        address: of the cluster; None for processes.
        most: how many processes have anything to do.

    Raises:
        HypermapError: If there is no such cluster.
    """
    if address is None:
        from hypermap.fleet.workers import Processes, cores

        with Processes(min(count or cores(), most)) as processes:
            yield processes
        return
    from hypermap.fleet.cluster import Cluster

    # What Ray prints is no result.
    with contextlib.redirect_stdout(sys.stderr), Cluster(address, count) as cluster:
        yield cluster
