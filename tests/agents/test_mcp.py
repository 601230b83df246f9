"""`hypermap mcp`, asked by the official SDK's own client over both transports."""

from __future__ import annotations

import base64
import contextlib
import io
import json
import os
import pty
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import anyio
import httpx2
import pytest
from PIL import Image

from hypermap import open_map
from hypermap.viewer.live.connections import MOST_CONNECTIONS

from ..prepared import Command, run

if TYPE_CHECKING:  # it takes half a second to import
    from mcp import Client

pytestmark = pytest.mark.xdist_group("mcp")

HYPERMAP = [sys.executable, "-m", "hypermap", "mcp"]
TOKEN = "a token of a test"
LIMIT = 240  # [s] for a whole conversation


def talk(office: Path, *options: str, to: Callable[[Client], Awaitable[None]]) -> None:
    """Start the program as clients do, and let one talk to it."""
    from mcp import Client, StdioServerParameters

    command, *words = HYPERMAP
    server = StdioServerParameters(command=command, args=[*words, str(office), *options])

    async def conversation() -> None:
        with anyio.fail_after(LIMIT):
            async with Client(server) as client:
                await to(client)

    anyio.run(conversation)


async def asked(client: Client, tool: str, /, **arguments: Any) -> dict[str, Any]:
    """Return a tool's answer, which stands in it twice."""
    result: Any = await client.call_tool(tool, arguments)
    assert not result.is_error, result.content
    assert json.loads(result.content[0].text) == result.structured_content
    answer: dict[str, Any] = result.structured_content
    return answer


async def refused(client: Client, tool: str, /, **arguments: Any) -> str:
    result: Any = await client.call_tool(tool, arguments)
    assert result.is_error
    text: str = result.content[0].text
    return text


@contextlib.contextmanager
def serving(office: Path, *options: str) -> Iterator[tuple[str, Command]]:
    words = ["mcp", office, "--http", "--port", 0, *options]
    with Command(*words, stderr=subprocess.PIPE) as process:
        try:
            assert process.stderr is not None
            line = process.stderr.readline()
            found = re.search(r"http://\S+/mcp", line)
            assert found is not None, line
            yield found[0], process
        finally:
            process.kill()


def test_connections_that_ask_for_nothing_keep_no_agent_out(office: Path) -> None:
    with serving(office) as (url, _), contextlib.ExitStack() as opened:
        address = "127.0.0.1", int(urlsplit(url).port or 0)
        idle = [
            opened.enter_context(socket.create_connection(address, timeout=LIMIT))
            for _ in range(MOST_CONNECTIONS + 1)
        ]
        idle[0].settimeout(LIMIT)
        assert idle[0].recv(1) == b""
        assert httpx2.get(url, timeout=LIMIT).status_code == 401


async def tools_answer(client: Client) -> None:
    tools = (await client.list_tools()).tools
    assert {tool.name for tool in tools} == {
        "find_objects",
        "find_like",
        "nearest",
        "what_is_at",
        "list_rooms",
        "describe_room",
        "path_to",
        "changes",
        "ask",
        "render_view",
        "show_object",
        "find_notes",
    }
    assert all(tool.annotations and tool.annotations.read_only_hint for tool in tools)
    found = await asked(client, "find_objects", names=["sofa"])
    assert [item["id"] for item in found["objects"]] == [6]
    picture: Any = await client.call_tool("render_view", {})
    assert base64.b64decode(picture.content[1].data).startswith(b"\x89PNG")
    printer: Any = await client.call_tool("show_object", {"id": 5, "number": 2})
    assert printer.content[0].text == "printer 5 of layer semantic, picture 2 of 2"
    assert printer.content[1].mime_type == "image/jpeg"
    with Image.open(io.BytesIO(base64.b64decode(printer.content[1].data))) as image:
        red, green, _ = image.getpixel((5, 5))
    assert green > 100 > red
    oven = {"id": 1, "layer": "semantic"}
    assert "the map has 0 pictures of oven 1" in await refused(client, "show_object", **oven)
    assert "no object 99" in await refused(client, "show_object", id=99)


async def the_map_says_what_it_is(client: Client) -> None:
    listed = (await client.list_resources()).resources
    read: dict[str, Any] = {}
    for resource in listed:
        (content,) = (await client.read_resource(resource.uri)).contents
        read[str(resource.uri)] = json.loads(content.text)  # type: ignore[union-attr]
    assert read["hypermap://summary"]["rooms"] == ["kitchen", "print room"]
    assert {"name": "cup", "count": 2} in read["hypermap://classes"]["classes"]
    assert len(read["hypermap://rooms"]["doors"]) == 1
    assert read["hypermap://query-schema"]["title"] == "A question about a hypermap"
    with pytest.raises(Exception, match="no resource"):
        await client.read_resource("hypermap://secrets")


async def wrong_calls_are_reported(client: Client) -> None:
    assert "find_objects" in await refused(client, "find_object")
    assert "limit: " in await refused(client, "find_objects", limit=10**6)
    assert "names: " in await refused(client, "find_objects", names={"a": [1]})
    assert "start: " in await refused(client, "nearest", name="cup")
    assert "no tool" in await refused(client, "mark_gone", id=3)  # without --allow-edits
    assert (await asked(client, "find_objects"))["count"] == 9


def test_edits_reach_the_file(office: Path) -> None:
    async def conversation(client: Client) -> None:
        await asked(client, "mark_gone", id=6)
        await asked(client, "add_zone", name="spill", corners=[[5, 2], [6, 2], [6, 3]])
        assert "name the layer" in await refused(client, "rename", id=0, name="x")

    talk(office, "--allow-edits", to=conversation)
    saved = open_map(office)
    assert 6 not in saved.semantic("semantic").ids
    assert [item.object.name for item in saved.objects(layer="zones")] == ["spill"]


async def ten_tasks_are_solved(client: Client) -> None:
    async def objects(tool: str, /, **arguments: Any) -> list[Any]:
        rows: list[Any] = (await asked(client, tool, **arguments))["objects"]
        return rows

    # 1. A place to sit within 3 m of the printer, the surest one.
    seats = await objects(
        "find_objects", names=["seating"], near_name="printer", within=3, which="surest"
    )
    assert {seat["id"] for seat in seats} == {6, 7}
    # 2. The room of the printer, and 3. what else is in it.
    (printer,) = await objects("find_objects", names=["printer"])
    room = await asked(client, "describe_room", room=printer["room"])
    assert {one["name"] for one in room["objects"]} == {"printer", "couch", "chair", "cup"}
    # 4. A cup for someone at the oven, on foot.
    (oven,) = await objects("find_objects", names=["oven"])
    (cup,) = await objects("nearest", name="cup", start=[oven["x"], 2.9], by="path")
    assert cup["id"] == 3
    # 5. What it stands on.
    stack = await objects("what_is_at", point=[cup["x"], cup["y"]])
    assert [item["name"] for item in stack] == ["cup", "dining table"]
    # 6. The way from there to the printer, and 7. the door that it leads through.
    path = await asked(client, "path_to", goal="printer", start=[2.2, 2.2])
    ((_, door_y),) = path["doors"]
    assert path["length"] > 4
    assert 1.0 <= door_y <= 1.9
    # 8. Where to cook: the room with an oven.
    cooking = await asked(client, "ask", question="which rooms have an oven?")
    assert [one["name"] for one in cooking["rooms"]] == ["kitchen"]
    # 9. What is new today, and 10. what has not been seen since.
    news = await asked(client, "changes", since="2026-11-23")
    assert [item["name"] for item in news["added"]] == ["cup"]
    assert [item["name"] for item in news["not_seen"]] == ["couch"]


def test_an_agent_is_answered_over_standard_input_and_output(office: Path) -> None:
    async def conversation(client: Client) -> None:  # one, as a server starts in a second
        await tools_answer(client)
        await the_map_says_what_it_is(client)
        await wrong_calls_are_reported(client)
        await ten_tasks_are_solved(client)

    talk(office, to=conversation)


def test_over_http_only_those_who_know_the_token_are_answered(office: Path) -> None:
    from mcp import Client
    from mcp.client.streamable_http import streamable_http_client

    async def conversation(url: str) -> None:
        headers = {"Authorization": f"Bearer {TOKEN}"}
        with anyio.fail_after(LIMIT):
            async with (
                httpx2.AsyncClient(headers=headers, timeout=LIMIT) as http,
                Client(streamable_http_client(url, http_client=http)) as client,
            ):
                found = await asked(client, "nearest", name="cup", start=[5, 3])
                assert [item["id"] for item in found["objects"]] == [8]

    with serving(office, "--token", TOKEN) as (url, _):
        anyio.run(conversation, url)
        request = {"jsonrpc": "2.0", "id": 1, "method": "tools/list"}
        accept = {"Accept": "application/json, text/event-stream"}
        for wrong in ({}, {"Authorization": "Bearer guessed"}, {"Authorization": f"Basic {TOKEN}"}):
            answer = httpx2.post(url, json=request, headers=accept | wrong, timeout=LIMIT)
            assert answer.status_code == 401
            assert "Authorization: Bearer" in answer.json()["error"]
        known = accept | {"Authorization": f"Bearer {TOKEN}"}
        elsewhere = httpx2.post(
            url, json=request, headers=known | {"Host": "evil.example"}, timeout=LIMIT
        )
        assert elsewhere.status_code == 421
        foreign = httpx2.post(
            url, json=request, headers=known | {"Origin": "http://evil.example"}, timeout=LIMIT
        )
        assert foreign.status_code == 403
        large = httpx2.post(url, content=b"[" * 3_000_000, headers=known, timeout=LIMIT)
        assert large.status_code == 413


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_server_ends_in_silence_whoever_broke_off(office: Path, number: signal.Signals) -> None:
    with serving(office, "--token", TOKEN) as (url, process):
        with socket.create_connection(("127.0.0.1", urlsplit(url).port or 0)) as broken_off:
            host = f"Host: {urlsplit(url).netloc}\r\nAuthorization: Bearer {TOKEN}\r\n"
            kind = "Accept: application/json, text/event-stream\r\nContent-Type: application/json"
            head = f"POST /mcp HTTP/1.1\r\n{host}{kind}\r\nContent-Length: 99\r\n\r\n"
            broken_off.sendall(f"{head}{{".encode())
        assert httpx2.get(url, timeout=LIMIT).status_code == 401
        process.send_signal(number)
        _, said = process.communicate(timeout=LIMIT)
        assert (said, process.wait()) == ("", 0)


def test_ctrl_c_at_a_terminal_ends_it(office: Path) -> None:
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [*HYPERMAP, str(office)], stdin=theirs, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        try:
            os.close(theirs)
            assert process.stderr is not None
            assert b"waiting for an agent" in process.stderr.readline()
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=LIMIT)
            assert (said, process.returncode) == (b"", 0)
        finally:
            process.kill()
            os.close(ours)


def test_a_client_that_goes_away_ends_it(office: Path) -> None:
    done = subprocess.run(
        [*HYPERMAP, str(office)], input=b"", capture_output=True, timeout=LIMIT, check=False
    )
    assert (done.returncode, done.stdout) == (0, b"")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--http", "--token", "short"], "at least 16"),
        (["--port", "9000"], "need --http"),
        (["--taxonomy", "missing.yaml"], "missing.yaml"),
    ],
)
def test_wrong_options_are_one_error(office: Path, options: list[str], words: str) -> None:
    done = run("mcp", office, *options, timeout=LIMIT)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_a_port_in_use_and_a_file_that_is_no_map_are_errors(office: Path, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        done = run("mcp", office, "--http", "--port", port, timeout=LIMIT)
    assert (done.returncode, port in done.stderr) == (2, True)
    broken = tmp_path / "broken.hmap"
    broken.write_bytes(b"no map")
    done = run("mcp", broken, timeout=LIMIT)
    assert (done.returncode, "broken.hmap" in done.stderr) == (2, True)
