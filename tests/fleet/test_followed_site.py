"""What others write to a site shows by itself: in memory, on the page, and in a map server."""

from __future__ import annotations

import re
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("psycopg", reason="psycopg is missing")

from starlette.testclient import TestClient
from typer.testing import CliRunner

from hypermap import GridGeometry, Hypermap, OccupancyLayer, SemanticLayer
from hypermap.cli.main import app
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.fleet.store.address import StoreError, parse_address, site_address
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.followed_site import FollowedSite
from hypermap.fleet.store.pushing import Conflict, pull, push
from hypermap.fleet.store.sites import SiteNotFound
from hypermap.fleet.store.updates import Update, apply
from hypermap.ros.typestore import message_class
from hypermap.testing import square
from hypermap.viewer.live.app import MapApp
from hypermap.viewer.live.followed_map import FollowedMap
from hypermap.viewer.live.page import is_page_built

from ..prepared import Command
from ..ros.foxglove_client import Client

pytestmark = pytest.mark.xdist_group("store")

SEEN_AFTER = 240.0  # s, on a machine that has much to do; a second is asked of others
ASK = "/hypermap_server/get_string_at_point", "hypermap_msgs/GetStringAtPoint"


@pytest.fixture
def lab(database: Database, site: str) -> str:
    """A site with a floor and a chair."""
    cells = np.zeros((40, 60), dtype=np.int8)
    floor = OccupancyLayer("occupancy", "map", GridGeometry(60, 40, 0.1), cells)
    frames = FrameTree([Transform("map", "dock", Pose2D(1, 2))])
    things = SemanticLayer("semantic", "map", [square("chair", 1, 1)])
    push(database, Hypermap([floor, things], frames), site)
    return site


@pytest.fixture
def followed(store: str, lab: str) -> Iterator[FollowedSite]:
    with FollowedSite(site_address(f"{store}&site={lab}")) as followed:
        yield followed


def find_a_cup(database: Database, site: str) -> None:
    apply(database, Update(site, "semantic", objects=(square("cup", 3, 3, id=7),)))


def until(is_so: Callable[[], Any], what: str) -> Any:
    end = time.monotonic() + SEEN_AFTER
    while not (answer := is_so()):
        assert time.monotonic() < end, f"no {what}"
        time.sleep(0.02)
    return answer


def test_a_followed_map_is_the_one_before_but_for_what_has_changed(
    database: Database, followed: FollowedSite, lab: str
) -> None:
    before = followed.hypermap
    assert before is followed.hypermap
    assert before.semantic().names.tolist() == ["chair"]
    find_a_cup(database, lab)
    after = until(lambda: followed.hypermap is not before and followed.hypermap, "change")
    assert after.semantic().names.tolist() == ["chair", "cup"]
    assert after["occupancy"] is before["occupancy"]
    assert before.semantic().names.tolist() == ["chair"]

    moved = FrameTree([Transform("map", "dock", Pose2D(5, 5))])
    push(database, Hypermap(list(after), moved, after.metadata), lab, update=True)
    newest = until(lambda: followed.hypermap is not after and followed.hypermap, "change")
    assert newest.frames.lookup("map", "dock") == Pose2D(5, 5)
    assert newest["occupancy"] is not after["occupancy"]  # what is drawn where is computed again


def test_the_map_stays_while_the_database_is_away(
    database: Database, followed: FollowedSite, lab: str
) -> None:
    before = followed.hypermap
    database.rows(
        "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid <> pg_backend_pid() "
        "AND application_name = 'hypermap' AND datname = current_database()"
    )
    assert followed.hypermap is before
    find_a_cup(database, lab)
    after = until(lambda: followed.hypermap is not before and followed.hypermap, "change")
    assert len(after.semantic()) == 2


def test_a_version_is_followed_no_more(database: Database, store: str, lab: str) -> None:
    find_a_cup(database, lab)
    with FollowedSite(site_address(f"{store}&site={lab}&version=1")) as old:
        assert old.hypermap.semantic().names.tolist() == ["chair"]
        assert (old.name, old.address) == (
            lab,
            parse_address(f"{store}&site={lab}&version=1").shown,
        )


def test_a_site_that_is_not_there_is_refused(store: str) -> None:
    with pytest.raises(SiteNotFound, match="there is no site 'nowhere'"):
        FollowedSite(site_address(f"{store}&site=nowhere"))


def test_changes_of_clients_are_written_and_conflicts_told(
    database: Database, followed: FollowedSite, lab: str
) -> None:
    seen = followed.hypermap
    before, after = seen.semantic(), seen.semantic().copy()
    after.rename(0, "stool")
    after.add(square("lamp", 2, 2))
    followed.write(seen, before, after)
    stored = pull(database, lab).semantic()
    assert stored.names.tolist() == ["stool", "lamp"]
    again = after.copy()  # before the change comes back from the store
    again.remove(0)
    followed.write(seen, after, again)
    assert pull(database, lab).semantic().names.tolist() == ["lamp"]
    until(lambda: followed.hypermap.semantic().names.tolist() == ["lamp"], "change")

    seen = followed.hypermap
    apply(database, Update(lab, "semantic", [square("cup", 2, 2, id=1)], seen={1: 2}))
    renamed, removed = seen.semantic().copy(), seen.semantic().copy()
    renamed.rename(1, "light")
    removed.remove(1)
    for changed in (renamed, removed):
        with pytest.raises(Conflict, match=r"object 1 of layer 'semantic' .* was changed, in"):
            followed.write(seen, seen.semantic(), changed)
    assert pull(database, lab).semantic().names.tolist() == ["cup"]


def test_a_former_version_takes_no_changes(store: str, lab: str) -> None:
    with FollowedSite(site_address(f"{store}&site={lab}&version=1")) as old:
        changed = old.hypermap.semantic().copy()
        changed.remove(0)
        with pytest.raises(StoreError, match="former version"):
            old.write(old.hypermap, old.hypermap.semantic(), changed)


def test_the_page_shows_what_others_find_and_takes_no_edits(
    database: Database, followed: FollowedSite, lab: str
) -> None:
    page = MapApp(FollowedMap(followed), is_private=False)
    with TestClient(page.app, base_url="http://127.0.0.1") as client:
        info = client.get("/api/map").json()
        assert (info["name"], info["editable"], info["can_cover"]) == (lab, False, False)
        find_a_cup(database, lab)

        def newer() -> Any:
            found = client.get("/api/map").json()
            return found["version"] > info["version"] and found

        versions = {layer["name"]: layer["version"] for layer in until(newer, "change")["layers"]}
        assert versions["semantic"] > info["version"]
        assert versions["occupancy"] == info["version"]  # and its tiles are not drawn again
        rows = client.get("/api/find", params={"name": "cup", "near": "0,0"}).json()["rows"]
        assert [(row["layer"], row["id"]) for row in rows] == [("semantic", 7)]
        headers = {"X-Hypermap-Token": info["token"]}
        body = {"version": 1, "operations": [{"op": "remove", "layer": "semantic", "id": 0}]}
        for path in ("edit", "undo", "save", "reload"):
            refused = client.post(f"/api/{path}", json=body, headers=headers)
            assert refused.status_code == 403
            assert refused.json()["error"] == "the map is read-only"


def test_a_page_in_a_file_holds_no_password_of_the_store(
    store: str, lab: str, tmp_path: Path
) -> None:
    if not is_page_built():
        pytest.skip("the page is not built (make page)")
    page = tmp_path / "lab.html"
    address = f"{store}&site={lab}&password=open+sesame"
    result = CliRunner().invoke(app, ["view", address, "--html", str(page)])
    assert result.exit_code == 0, result.output
    assert f"{lab}.hmap" in page.read_text()
    assert "sesame" not in page.read_text() + result.output


def test_a_map_server_serves_what_others_find(
    database: Database, store: str, lab: str, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    with log.open("wb") as output:
        words = ["serve", f"{store}&site={lab}", "--foxglove", "--port", "0", "--allow-edits"]
        server = Command(*words, stdout=output, stderr=subprocess.STDOUT)
    try:
        url = until(lambda: re.search(r"ws://\S+", log.read_text()), "address")[0]
        with Client(url) as client:
            client.wait(lambda: ASK[0] in client.services, "the services")
            place = message_class("geometry_msgs/PointStamped")()
            place.header.frame_id, place.point.x, place.point.y = "map", 3.0, 3.0

            def name_there() -> str:
                answer = client.call(*ASK, layer="semantic", location=place)
                return str(answer.name)

            assert name_there() == "Empty"
            find_a_cup(database, lab)
            until(lambda: name_there() == "cup", "cup")
            update = message_class("hypermap_msgs/SemanticMapUpdate")()
            update.to_delete = [7]
            topic = "/hypermap_server/semantic_semmap_updates"
            client.publish(client.advertise(topic, "hypermap_msgs/SemanticMapUpdate"), update)
            until(lambda: len(pull(database, lab).semantic()) == 1, "deletion")
            until(lambda: name_there() == "Empty", "empty place")
    finally:
        server.terminate()
        server.wait(240)
