"""Parses the tokens of a question with the grammar in `english.lark`."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from lark import Lark, Token
from lark.exceptions import UnexpectedInput, VisitError
from lark.lexer import Lexer

from hypermap.questions.grammar.sentences import Sentences
from hypermap.questions.query import Query
from hypermap.questions.times import Span

_GRAMMAR = Path(__file__).with_name("english.lark")


def query_of(tokens: list[Token], times: list[Span]) -> Query:
    """Return the query that a sentence asks.

    Args:
        tokens: its words.
        times: what its time marks stand for.

    Raises:
        ValueError: If the sentence cannot be read, or has two meanings; its text says so.
    """
    try:
        query: Query = Sentences(times, tokens).transform(_parser().parse(tokens))
    except UnexpectedInput as error:
        last = getattr(error, "token", None)
        raise ValueError(f"cannot read this question{_from(last, times)}") from None
    except VisitError as error:
        raise ValueError(str(error.orig_exc)) from None
    return query


def _from(token: Token | None, times: list[Span]) -> str:
    """Return from which token on a sentence cannot be read, as it stands there."""
    if not token:
        return ""
    if token.type != "TIME":
        return f" from {str(token)!r} on"
    hint = "say 'seen on Monday', or 'as of Monday' for the map as it was"
    return f" from {times[int(token)].text!r} on; {hint}"


class _Tokens(Lexer):
    """A lexer that passes on existing tokens."""

    def __init__(self, _configuration: Any) -> None:
        pass

    def lex(self, lexer_state: Any, parser_state: Any = None) -> Iterator[Token]:  # noqa: ARG002
        """Yield them."""
        yield from lexer_state


@cache
def _parser() -> Lark:
    return Lark(_GRAMMAR.read_text(encoding="utf-8"), parser="earley", lexer=_Tokens)
