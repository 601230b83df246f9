"""Texts that no file can contain: unpaired surrogates, as JSON can spell them."""

from __future__ import annotations

from hypermap.core.errors import FormatError, HypermapError


def is_whole(text: str) -> bool:
    r"""Return whether a text is one; some hold a surrogate, half of a character, alone.

    >>> is_whole("caf\u00e9"), is_whole("caf\ud83d")
    (True, False)
    """
    if text.isascii():
        return True
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def check_savable(text: str, what: str) -> None:
    """Make sure that a text can be saved.

    Args:
        text: any.
        what: how the message names it.

    Raises:
        HypermapError: If it holds half of a character.
    """
    if not is_whole(text):
        raise HypermapError(f"{what} cannot be saved: {_half(text)}; give it another text")


def check_read(text: str, path: str | None, place: str) -> None:
    """Make sure that a text that was read is one.

    Raises:
        FormatError: If it holds half of a character.
    """
    if not is_whole(text):
        raise FormatError(_half(text), path=path, key=place)


def _half(text: str) -> str:
    place = next(i for i, letter in enumerate(text) if "\ud800" <= letter <= "\udfff")
    around = text[max(place - 20, 0) : place + 20]
    return f"{around!a} holds half of a character, {text[place]!a}"
