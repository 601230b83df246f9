"""Programs and GIS read sites from the service, as OGC API - Features says, and edit if allowed."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
import shapely

pytest.importorskip("psycopg", reason="psycopg is missing")

from starlette.testclient import TestClient

from hypermap import Hypermap, SemanticLayer, from_geojson
from hypermap.fleet.store.address import parse_address
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.pushing import pull, push
from hypermap.fleet.store.service.app import StoreService
from hypermap.testing import square

from ..prepared import Command

pytestmark = pytest.mark.xdist_group("store")

TOKEN = "a token of the tests"
SITE = "served & read / upstairs"
AUTUMN = 1764000000.0  # 2025-11-24T16:00:00Z
CUP = {
    "type": "Feature",
    "geometry": {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]},
    "properties": {"name": "cup", "tags": ["mug"]},
}


def a_map() -> Hypermap:
    chairs = [
        square(
            "chair", x, 0, tags=("seat",), first_seen=AUTUMN + 100 * x, last_seen=AUTUMN + 150 * x
        )
        for x in range(5)
    ]
    table = square("table", 2, 5, attributes={"when": float("nan")})
    return Hypermap([SemanticLayer("semantic", "map", [*chairs, table])])


def client_of(store: str, *, allows_edits: bool, url: str | None = None) -> Iterator[Any]:
    service = StoreService(parse_address(store), TOKEN, allows_edits=allows_edits, url=url)
    headers = {"Authorization": f"Bearer {TOKEN}"}
    with TestClient(service.app, headers=headers) as client:
        yield client
    service.connections.close()


@pytest.fixture(scope="module")
def reader(store: str) -> Iterator[Any]:
    database = Database(parse_address(store))
    push(database, a_map(), SITE)
    database.close()
    yield from client_of(store, allows_edits=False)


@pytest.fixture
def editor(store: str) -> Iterator[Any]:
    yield from client_of(store, allows_edits=True)


ITEMS = f"/collections/{quote(SITE, safe='')}:semantic/items"


def follow(reader: Any, page: dict[str, Any], rel: str) -> Any:
    (href,) = [link["href"] for link in page["links"] if link["rel"] == rel]
    answer = reader.get(href)
    assert answer.status_code == 200, answer.text
    return answer


def links_in(found: Any) -> list[str]:
    """Return all addresses in an answer."""
    if isinstance(found, dict):
        own = [found[key] for key in ("href", "url") if key in found]
        return own + [link for value in found.values() for link in links_in(value)]
    return [link for value in found for link in links_in(value)] if isinstance(found, list) else []


@pytest.mark.parametrize("url", ["https://maps.example/objects", "https://maps.example/objects/"])
def test_behind_a_web_server_all_links_begin_with_its_address(
    reader: Any, store: str, url: str
) -> None:
    for client in client_of(store, allows_edits=False, url=url):
        for path in ("/", "/api", "/collections", ITEMS.removesuffix("/items"), ITEMS):
            links = links_in(client.get(path, params={"limit": 1} if path == ITEMS else {}).json())
            assert links
            assert [link for link in links if not link.startswith("https://maps.example/o")] == []
            assert not any("//" in link.removeprefix("https://") for link in links)


def test_links_lead_from_the_landing_page_to_an_object(reader: Any) -> None:
    landing = reader.get("/").json()
    conformance = follow(reader, landing, "conformance").json()["conformsTo"]
    assert {uri.rsplit("/", 1)[1] for uri in conformance} == {"core", "oas30", "geojson"}
    found = follow(reader, landing, "data").json()["collections"]
    (mine,) = [each for each in found if each["id"] == f"{SITE}:semantic"]
    assert mine["extent"]["spatial"]["bbox"] == [[-0.5, -0.5, 4.5, 5.5]]
    page = follow(reader, mine, "items")
    assert page.headers["content-type"] == "application/geo+json"
    assert page.json()["numberMatched"] == page.json()["numberReturned"] == 6
    one = reader.get(f"{ITEMS}/5").json()
    assert (one["properties"]["name"], one["version"]) == ("table", 1)
    assert one["properties"]["when"] is None


def test_the_description_is_openapi_and_knows_every_route(reader: Any) -> None:
    described = follow(reader, reader.get("/").json(), "service-desc").json()
    assert described["openapi"].startswith("3.0")
    routes = {
        route.path.replace("{collection:path}", "{collectionId}").replace(
            "{feature}", "{featureId}"
        )
        for route in reader.app.routes
    }
    assert set(described["paths"]) == routes
    parameters = {
        each["name"]
        for each in described["paths"]["/collections/{collectionId}/items"]["get"]["parameters"]
        if "name" in each
    }
    assert parameters == {"bbox", "datetime", "limit", "offset", "name", "tag"}


def test_the_items_are_a_geojson_layer(reader: Any) -> None:
    layer = from_geojson(reader.get(ITEMS).text, frame_id="map")
    assert [item.name for item in layer.objects()] == ["chair"] * 5 + ["table"]


@pytest.mark.parametrize(
    ("query", "ids"),
    [
        ("bbox=0.6,-1,2.4,1", [1, 2]),
        ("bbox=0.6,-1,0,2.4,1,9", [1, 2]),
        ("bbox=100,100,101,101", []),
        ("name=table", [5]),
        ("tag=seat&bbox=-9,-9,9,9&limit=2", [0, 1]),
        ("datetime=2025-11-24T16:00:00Z", [0]),
        ("datetime=2025-11-24T16:02:00Z", [1]),
        ("datetime=../2025-11-24T16:02:00Z", [0, 1]),
        ("datetime=2025-11-24T16:07:00%2B00:00/..", [3, 4]),
        ("offset=4&limit=9", [4, 5]),
        ("limit=999999999", [0, 1, 2, 3, 4, 5]),
    ],
)
def test_parameters_choose_features(reader: Any, query: str, ids: list[int]) -> None:
    assert [each["id"] for each in reader.get(f"{ITEMS}?{query}").json()["features"]] == ids


def test_pages_follow_each_other(reader: Any) -> None:
    page, ids = reader.get(f"{ITEMS}?limit=2&tag=seat").json(), []
    while True:
        ids += [each["id"] for each in page["features"]]
        if not any(link["rel"] == "next" for link in page["links"]):
            break
        page = follow(reader, page, "next").json()
    assert ids == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    "query",
    [
        "bbox=1,2,3",
        "bbox=3,0,1,1",
        "bbox=a,b,c,d",
        "bbox=nan,0,1,1",
        "limit=0",
        "limit=-1",
        "limit=x",
        "offset=-1",
        "datetime=soon",
        "datetime=2025-01-02/2025-01-01",
        "datetime=..",
        "colour=red",
        "name=a%00b",
    ],
)
def test_a_wrong_parameter_is_a_bad_request_that_says_which(reader: Any, query: str) -> None:
    answer = reader.get(f"{ITEMS}?{query}")
    assert answer.status_code == 400
    assert query.partition("=")[0] in answer.json()["description"]


@pytest.mark.parametrize(
    "path",
    [
        "/collections/no:where",
        "/collections/no:where/items",
        f"{ITEMS}/99",
        f"{ITEMS}/x",
        f"{ITEMS}/1' OR true --",
        "/elsewhere",
        "/collections/%00/items",
    ],
)
def test_what_is_not_there_is_not_found(reader: Any, path: str) -> None:
    assert reader.get(path).status_code == 404


def test_nothing_is_read_without_the_token_and_nothing_changed_unless_allowed(
    reader: Any, editor: Any
) -> None:
    for client, call in ((reader, "get"), (editor, "post")):
        answer = getattr(client, call)(ITEMS, headers={"Authorization": "Bearer other"})
        assert answer.status_code == 401
    assert reader.post(ITEMS, json=CUP).status_code == 405
    assert reader.delete(f"{ITEMS}/1").status_code == 405


def test_an_editor_adds_replaces_and_removes(editor: Any, database: Database, site: str) -> None:
    push(database, a_map(), site)
    items = f"/collections/{site}:semantic/items"
    added = editor.post(items, json=CUP)
    assert (added.status_code, added.json()) == (201, {"id": 6})
    renamed = {**CUP, "properties": {"name": "mug"}}
    assert editor.put(f"{items}/6", json=renamed).status_code == 400  # which version?
    late = editor.put(f"{items}/6", json=renamed, headers={"If-Match": "1"})
    assert late.status_code == 412
    assert late.json()["description"] == (
        f"http://testserver: object 6 of layer 'semantic' of site {site!r} was changed, in version "
        "2, by someone else; read it again"
    )
    assert editor.put(f"{items}/6", json=renamed, headers={"If-Match": '"2"'}).status_code == 204
    assert editor.get(f"{items}/6").json()["properties"]["name"] == "mug"
    assert editor.delete(f"{items}/0", headers={"If-Match": "1"}).status_code == 204
    assert pull(database, site).semantic().ids.tolist() == [1, 2, 3, 4, 5, 6]
    for nul in ("a\0b", "\\\0"):
        refused = editor.post(items, json={**CUP, "properties": {"name": nul}})
        assert (refused.status_code, "NUL" in refused.text) == (400, True)
    backslash = {**CUP, "properties": {"name": "\\u0000"}}
    assert editor.post(items, json=backslash).status_code == 201
    nan = (
        b'{"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[[0, 0], [NaN, 1]]]}}'
    )
    for body in (b"", b"{}", b"[" * 100_000, nan, b'{"x": "' + b"x" * 1_000_001):
        assert editor.post(items, content=body).status_code == 400


@pytest.mark.parametrize("url", ["maps.example", "https://", "https://me:word@maps.example"])
def test_links_begin_with_the_address_of_a_web_server_alone(store: str, url: str) -> None:
    with Command("api", store, "--port", 0, "--public-url", url, stderr=subprocess.PIPE) as process:
        said = process.communicate(timeout=240)[1]
        assert process.wait() == 2
    assert said.count("\n") == 1
    assert "--public-url must be the address of a web server" in said
    assert "word" not in said


@pytest.mark.parametrize(
    ("words", "ready"),
    [
        (["api", "{store}", "--port", "0"], "Authorization"),
        (["pull", "{store}", "--site", SITE, "-o", "{folder}/a.hmap", "--follow"], "version"),
    ],
)
def test_sigterm_is_the_usual_end_of_what_serves_or_follows(
    reader: Any, store: str, tmp_path: Path, words: list[str], ready: str
) -> None:
    command = [word.format(store=store, folder=tmp_path) for word in words]
    with Command(*command, stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if ready in line:
                break
        process.terminate()
        assert process.communicate(timeout=240)[1] == ""
        assert process.wait() == 0


def test_clients_of_a_store_that_is_away_do_not_read_where_its_database_is(tmp_path: Path) -> None:
    away = f"postgresql://owner@/store?host={tmp_path}"
    for client in client_of(away, allows_edits=False):
        answer = client.get("/collections")
        assert answer.status_code == 503
        assert answer.json()["description"] == (
            "http://testserver: the store does not answer; try again later"
        )


def test_gdal_reads_a_site_with_special_characters_page_by_page(store: str, reader: Any) -> None:
    pyogrio = pytest.importorskip("pyogrio", reason="pyogrio is missing")
    # The service is another process: pyogrio keeps Python's lock while it reads.
    with Command("api", store, "--port", 0, "--token", TOKEN, stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        line = next(line for line in process.stderr if "http://" in line)
        (url,) = re.findall(r"http://[\w.:]+", line)
        options = {"GDAL_HTTP_AUTH": "BEARER", "GDAL_HTTP_BEARER": TOKEN}
        options["OGR_OAPIF_INITIAL_REQUEST_PAGE_SIZE"] = "2"
        pyogrio.set_gdal_config_options(options)
        _, _, shapes, (names,) = pyogrio.raw.read(
            f"OAPIF:{url}", f"{SITE}:semantic", columns=["name"]
        )
        process.terminate()
        process.communicate(timeout=240)
        assert process.wait() == 0
    pyogrio.set_gdal_config_options(dict.fromkeys(options))
    found = sorted(zip(names, shapely.area(shapely.from_wkb(shapes)).tolist(), strict=True))
    assert found == [("chair", 1.0)] * 5 + [("table", 1.0)]
