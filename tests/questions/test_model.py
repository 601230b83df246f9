"""A language model that reads questions: a server in its place, which misbehaves, too."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest
import shapely

from hypermap import Hypermap, HypermapError, SemanticLayer, SemanticObject
from hypermap.questions import LanguageModel, NotUnderstood
from hypermap.questions.asking import answer_to

KEY = "a-secret"
QUESTION = "I could do with something to drink from"


class Endpoint:
    """An endpoint that gives the answers that a test has written, in turn.

    Attributes:
        url: its address.
        answers: each a message's content, or (status, headers, bytes), or what to do instead.
        requests: what it was asked: headers and body.
    """

    def __init__(self) -> None:
        endpoint = self
        self.answers: list[Any] = []
        self.requests: list[tuple[dict[str, str], Any]] = []

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                endpoint.requests.append((dict(self.headers), json.loads(body)))
                answer = endpoint.answers.pop(0)
                if callable(answer):
                    answer = answer()
                if isinstance(answer, str):
                    message = {"choices": [{"message": {"role": "assistant", "content": answer}}]}
                    answer = (200, {}, json.dumps(message).encode())
                status, headers, content = answer
                self.send_response(status)
                for name, value in headers.items():
                    self.send_header(name, value)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, *_: Any) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}/v1"


@pytest.fixture
def endpoint() -> Iterator[Endpoint]:
    made = Endpoint()
    thread = threading.Thread(target=made.server.serve_forever, daemon=True)
    thread.start()
    yield made
    made.server.shutdown()
    made.server.server_close()
    thread.join()


@pytest.fixture
def kitchen() -> Hypermap:
    things = [SemanticObject("cup", shapely.box(x, 0, x + 0.1, 0.1)) for x in (0, 2)]
    return Hypermap([SemanticLayer("semantic", "map", things)])


@pytest.fixture
def ask(endpoint: Endpoint, kitchen: Hypermap) -> Callable[..., Any]:
    def asked(question: str = QUESTION, timeout: float = 240.0) -> Any:
        return answer_to(kitchen, question, model=LanguageModel(endpoint.url, "m", KEY, timeout))

    return asked


QUERY = '{"names": ["cup"], "which": "surest"}'


def test_it_reads_what_the_grammar_cannot(endpoint: Endpoint, ask: Callable[..., Any]) -> None:
    endpoint.answers = [QUERY]
    answer = ask()
    assert (answer.query.names, answer.query.which, answer.count) == (("cup",), "surest", 1)
    assert answer.notes == ("the language model m read the question",)
    ((headers, body),) = endpoint.requests
    assert headers["Authorization"] == f"Bearer {KEY}"
    assert (body["model"], body["temperature"]) == ("m", 0)
    system, user = body["messages"]
    assert user == {"role": "user", "content": QUESTION}
    assert '"objects": ["cup"]' in system["content"]
    assert "A question about a hypermap" in system["content"]


def test_it_is_not_asked_what_the_grammar_can_read(
    endpoint: Endpoint, ask: Callable[..., Any]
) -> None:
    assert ask("how many cups are there?").count == 2
    assert endpoint.requests == []


def test_without_a_model_nothing_is_asked(kitchen: Hypermap) -> None:
    with pytest.raises(NotUnderstood):
        answer_to(kitchen, QUESTION)


@pytest.mark.parametrize("content", [f"```json\n{QUERY}\n```", f"  {QUERY}\n", f"```{QUERY}```"])
def test_a_fence_around_the_query_is_no_matter(
    endpoint: Endpoint, ask: Callable[..., Any], content: str
) -> None:
    endpoint.answers = [content]
    assert ask().query.names == ("cup",)


def test_it_is_reported_once_what_was_wrong(endpoint: Endpoint, ask: Callable[..., Any]) -> None:
    endpoint.answers = ['{"names": ["cup"], "color": "red"}', QUERY]
    assert ask().query.names == ("cup",)
    *_, (_, body) = endpoint.requests
    assert "there is no key 'color'" in body["messages"][-1]["content"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("The nearest cup is on the table.", "not JSON"),
        ('{"names": ["cup"]', "not JSON"),
        ("[" * 100_000, "not JSON"),
        ('{"names": "cup"}', "names: expected a list"),
        ('{"names": ["cup"], "which": "prettiest"}', "prettiest"),
        ('{"names": ["cup"], "count": 1e9}', "count"),
        ("[]", "expected an object"),
        ('{"where": [{"relation": "near", "what": {"point": [NaN, 1]}}]}', "point"),
    ],
)
def test_what_is_no_query_is_an_error(
    endpoint: Endpoint, ask: Callable[..., Any], content: str, words: str
) -> None:
    endpoint.answers = [content, content]
    with pytest.raises(HypermapError, match="the model m gave no query") as error:
        ask()
    assert words in str(error.value)
    assert len(endpoint.requests) == 2


def test_it_may_say_that_the_map_cannot_tell(endpoint: Endpoint, ask: Callable[..., Any]) -> None:
    endpoint.answers = ['{"cannot": "the map knows no colors"}']
    with pytest.raises(HypermapError, match="cannot answer this: the map knows no colors"):
        ask("what color is the cup?")


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ((401, {}, b'{"error": "wrong key"}'), "answered 401: .*wrong key"),
        ((500, {}, b"<html>" * 100_000), "answered 500"),
        ((307, {"Location": "http://elsewhere.invalid/"}, b""), "answered 307"),
        ((200, {}, b""), "OpenAI-compatible"),
        ((200, {}, b'{"choices": []}'), "OpenAI-compatible"),
        ((200, {}, b'{"choices": [{"message": {"content": 7}}]}'), "OpenAI-compatible"),
        ((200, {}, b"\xff\xfe"), "OpenAI-compatible"),
        ((200, {}, b" " * 2_000_000), "more than 1000000 bytes"),
    ],
)
def test_an_endpoint_that_fails_is_named(
    endpoint: Endpoint, ask: Callable[..., Any], answer: Any, words: str
) -> None:
    endpoint.answers = [answer]
    with pytest.raises(HypermapError, match=words) as error:
        ask()
    assert endpoint.url in str(error.value)
    assert KEY not in str(error.value)
    assert len(str(error.value)) < 600


def test_an_endpoint_that_takes_too_long_is_given_up(
    endpoint: Endpoint, ask: Callable[..., Any]
) -> None:
    given_up = threading.Event()

    def slowly() -> str:
        given_up.wait()
        return QUERY

    endpoint.answers = [slowly]
    with pytest.raises(HypermapError, match="does not answer: timed out"):
        ask(timeout=0.2)
    given_up.set()


def test_an_endpoint_that_is_away_is_named(kitchen: Hypermap) -> None:
    with socket.socket() as closed:  # it has a port, so that nobody else has, but does not listen
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
        with pytest.raises(HypermapError, match=f"127.0.0.1:{port}/v1 does not answer"):
            answer_to(kitchen, QUESTION, model=LanguageModel(f"http://127.0.0.1:{port}/v1", "m"))


@pytest.mark.parametrize(
    "url",
    ["", "localhost", "file:///etc/passwd", "http://", "ftp://a/b", "http://[::1", "http://a b"],
)
def test_what_is_no_address_is_refused(url: str) -> None:
    with pytest.raises(HypermapError, match="not the address of a model"):
        LanguageModel(url, "m")


def test_a_key_that_no_header_can_have_is_refused_and_not_shown() -> None:
    with pytest.raises(HypermapError) as error:
        LanguageModel("http://localhost/v1", "m", "secret\r\nX: y")
    assert "secret" not in str(error.value)
    assert "secret" not in repr(LanguageModel("http://localhost/v1", "m", "secret"))


def test_a_question_of_a_whole_book_is_not_sent(
    endpoint: Endpoint, ask: Callable[..., Any]
) -> None:
    with pytest.raises(HypermapError, match="at most 2000 characters"):
        ask("drink " * 1000)
    assert endpoint.requests == []
