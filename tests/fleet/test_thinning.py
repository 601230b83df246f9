"""Old versions of a site are removed; what is left is as it was."""

from __future__ import annotations

import json
import time

import pytest

pytest.importorskip("psycopg", reason="psycopg is missing")

from hypermap import Hypermap, SemanticLayer
from hypermap.cli.main import main
from hypermap.fleet.store.address import StoreError, parse_address, site_address
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.followed_site import FollowedSite
from hypermap.fleet.store.pushing import pull, push
from hypermap.fleet.store.sites import history
from hypermap.fleet.store.thinning import DAY, thin
from hypermap.fleet.store.updates import Update, apply
from hypermap.testing import square

pytestmark = pytest.mark.xdist_group("store")


@pytest.fixture
def old_site(database: Database, site: str) -> str:
    """A site with a cup that has moved each day of the last five, and a bed that has not."""
    things = [square("cup", 0, 0, id=0), square("bed", 9, 9, id=1)]
    push(database, Hypermap([SemanticLayer("semantic", "map", things)]), site)
    for x in range(1, 6):
        apply(database, Update(site, "semantic", [square("cup", x, 0, id=0)], seen={0: x}))
    with database.transaction() as cursor:
        cursor.execute(
            "UPDATE versions SET at = now() - (6.5 - version) * interval '1 day' WHERE site_id = "
            "(SELECT id FROM sites WHERE name = %s)",
            (site,),
        )
    return site


def places(database: Database, site: str, version: int | None = None) -> list[float]:
    """Return the x of each thing."""
    return [item.footprint.bounds[0] for item in pull(database, site, version).semantic()]


def test_thin_on_a_full_disk_removes_nothing(
    database: Database, old_site: str, store: str, capsys: pytest.CaptureFixture[str]
) -> None:
    connection = database.connected()
    connection.execute(
        "CREATE FUNCTION public.full_disk() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN "
        "RAISE EXCEPTION USING ERRCODE = 'disk_full', MESSAGE = 'could not extend file'; END $$"
    )
    connection.execute(
        "CREATE TRIGGER full_disk BEFORE DELETE ON versions EXECUTE FUNCTION public.full_disk()"
    )
    before = [places(database, old_site, version) for version in range(1, 7)]
    try:
        with pytest.raises(SystemExit, match="2"):
            main(["thin", store, "--site", old_site, "--keep-for", "2d"])
    finally:
        connection.execute("DROP FUNCTION public.full_disk CASCADE")
    said = capsys.readouterr().err
    assert f"{old_site}: not thinned: " in said
    assert "the disk of the database is full; free space there, and try again" in said
    assert [places(database, old_site, version) for version in range(1, 7)] == before


def test_versions_of_the_time_that_is_kept_stay_as_they_were(
    database: Database, old_site: str
) -> None:
    before = {version: places(database, old_site, version) for version in range(1, 7)}
    done = thin(database, old_site, keep=2 * DAY)
    assert (done.first, done.versions, done.rows) == (4, 3, 3)
    assert {version: places(database, old_site, version) for version in (4, 5, 6)} == {
        version: before[version] for version in (4, 5, 6)
    }
    assert [each.version for each in history(database, old_site)] == [6, 5, 4]
    with pytest.raises(StoreError, match="has no version 3: 4 to 6"):
        pull(database, old_site, 3)
    assert thin(database, old_site, keep=2 * DAY).rows == 0


def test_no_more_megabytes_stay_than_asked_but_for_the_last_day(
    database: Database, old_site: str
) -> None:
    assert thin(database, old_site, max_mb=1.0).versions == 0
    done = thin(database, old_site, max_mb=1e-6)
    assert (done.first, done.versions) == (5, 4)
    assert places(database, old_site) == places(database, old_site, 6) == [4.5, 8.5]


def test_versions_that_take_no_space_stay(database: Database, site: str) -> None:
    push(database, Hypermap([SemanticLayer("semantic", "map", [square("cup", 0, 0)])]), site)
    apply(database, Update(site, "semantic", [square("bed", 9, 9)]))
    with database.transaction() as cursor:
        cursor.execute(
            "UPDATE versions SET at = now() - (4 - version) * interval '1 day' WHERE site_id = "
            "(SELECT id FROM sites WHERE name = %s)",
            (site,),
        )
    assert thin(database, site, max_mb=1.0).versions == 0
    assert places(database, site, 1) == [-0.5]


def test_a_map_that_was_last_read_before_what_is_left_is_read_anew(
    database: Database, store: str, old_site: str
) -> None:
    followed = FollowedSite(site_address(f"{store}&site={old_site}"))
    apply(database, Update(old_site, "semantic", removed=[0], seen={0: 6}))
    with database.transaction() as cursor:
        cursor.execute(
            "UPDATE versions SET at = at - interval '9 days' WHERE site_id = "
            "(SELECT id FROM sites WHERE name = %s)",
            (old_site,),
        )
    assert thin(database, old_site, keep=DAY).first == 7
    with followed:
        end = time.monotonic() + 240
        while len(followed.hypermap.semantic()) > 1:
            assert time.monotonic() < end
            time.sleep(0.01)


def test_the_command_thins_a_site_and_says_what_it_removed(
    database: Database, store: str, old_site: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for keep, code in (("12h", 2), ("soon", 2), ("1d", 0)):
        with pytest.raises(SystemExit) as ended:
            main(["thin", store, "--site", old_site, "--keep-for", keep, "--json"])
        assert (ended.value.code or 0) == code
    said = capsys.readouterr()
    assert "the last day of a store always stays" in said.err
    assert '"first": 5' in said.out


def test_a_site_that_fails_is_named_and_the_others_are_thinned(
    database: Database, store: str, old_site: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A trigger refuses to remove the first versions of one of all sites."""
    layer = SemanticLayer("semantic", "map")
    other = f"a refusing {old_site}"
    push(database, Hypermap([layer]), other, note="refuse")
    push(database, Hypermap([layer]), other, update=True, force=True)
    connection = database.connected()
    connection.execute(
        """UPDATE versions SET at = at - interval '9 days' WHERE site_id =
            (SELECT id FROM sites WHERE name = %s)""",
        (other,),
    )
    connection.execute(
        """CREATE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS
            $$ BEGIN RAISE insufficient_privilege USING MESSAGE = 'no'; END $$"""
    )
    connection.execute(
        """CREATE TRIGGER refusing BEFORE DELETE ON versions FOR EACH ROW
            WHEN (OLD.note = 'refuse') EXECUTE FUNCTION refuse()"""
    )
    try:
        with pytest.raises(SystemExit) as ended:
            main(["thin", store, "--keep-for", "1d", "--json"])
    finally:
        connection.execute("DROP TRIGGER refusing ON versions")
    said = capsys.readouterr()
    assert ended.value.code == 2
    assert f"{other}: not thinned: " in said.err
    assert {"site": old_site, "first": 5, "versions": 4, "rows": 4} in json.loads(said.out)


def test_only_an_administrator_removes_versions(
    database: Database, store: str, old_site: str
) -> None:
    with database.transaction() as cursor:
        cursor.execute("CREATE ROLE thinner LOGIN IN ROLE hypermap_editor")
    robot = Database(parse_address(store.replace("owner@", "thinner@")))
    with pytest.raises(StoreError, match="permission denied"):
        thin(robot, old_site)
    robot.close()
    assert len(history(database, old_site)) == 6
