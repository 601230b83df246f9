"""`hypermap detectors`: networks that find objects, known by name, and their download."""

from __future__ import annotations

import enum
from dataclasses import asdict
from typing import Annotated

import typer

from hypermap.cli.options import AsJson
from hypermap.cli.terminal import note, out, say, say_json, table
from hypermap.core.errors import HypermapError, did_you_mean


class Action(str, enum.Enum):
    """What to do with the networks."""

    list = "list"
    get = "get"


def command(
    action: Annotated[
        Action, typer.Argument(help="list: show the networks. get: download one.")
    ] = Action.list,
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", show_default=False, help="Name of the network, for get."),
    ] = None,
    url: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            envvar="HYPERMAP_DETECTOR_URL",
            show_default=False,
            help="Download from this mirror; the file must be the same.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List neural networks for object detection, or download one to the cache.

    After the download, use it by `--detector NAME`. An interrupted download continues when you run
    the command again. The file is accepted only with the right SHA-256. You can use any other
    network in an ONNX file by its path, and detectors of other packages: see docs/detectors.md.

    Examples:
        hypermap detectors
        hypermap detectors get yolox-nano
        hypermap map RECORDING --detector yolox-nano -o office.hmap
    """
    if action is Action.get:
        _get(name, url)
    elif name is not None:
        raise HypermapError("a name belongs to `hypermap detectors get NAME`")
    else:
        _list(as_json)


def _list(as_json: bool) -> None:
    from hypermap.perception.detectors.catalog import NETWORKS

    if as_json:
        networks = [{**asdict(n), "path": n.path, "is_here": n.path.is_file()} for n in NETWORKS]
        say_json(networks)
        return
    rows = table("name", "size", "license", "classes", "made by", "note", right=("size",))
    for n in NETWORKS:
        here = "downloaded; " if n.path.is_file() else ""
        size = f"{n.size / 1e6:.1f} MB"
        rows.add_row(n.name, size, n.license, n.classes, n.source, here + n.note)
    out().print(rows)
    for n in NETWORKS:
        say(f"\n{n.name}\n  from    {n.url}\n  sha256  {n.sha256}")
    say("\ndownload one once:  hypermap detectors get yolox-nano")


def _get(name: str | None, url: str | None) -> None:
    from hypermap.cli.progress import downloading
    from hypermap.perception.detectors.catalog import NETWORKS, known_network
    from hypermap.perception.detectors.download import download

    names = [network.name for network in NETWORKS]
    if name is None:
        raise HypermapError(f"which one? hypermap detectors get NAME; {did_you_mean('', names)}")
    network = known_network(name)
    if network is None:
        raise HypermapError(f"there is no network {name!r} to get; {did_you_mean(name, names)}")
    with downloading(network.name, network.size) as report:
        path = download(network, url, report)
    note(f"{network.name} is here, with the right SHA-256: {path}")
    note(f"now try:  hypermap map RECORDING --detector {network.name} -o office.hmap")
