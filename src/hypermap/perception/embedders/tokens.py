"""Texts as numbers of tokens, by the `tokenizer.json` next to an encoder of texts."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hypermap.core.errors import FileMissing, FormatError, MissingExtra

try:
    import tokenizers
except ImportError:
    raise MissingExtra("reading a tokenizer", "embeddings") from None

_LONGEST = 1024  # tokens


@dataclass(frozen=True)
class TokenizedText:
    """The tokens of a text.

    Attributes:
        ids: their numbers.
        mask: 1 for each token of the text, 0 for padding.
    """

    ids: list[int]
    mask: list[int]


class Tokens:
    """Reads texts as an encoder was trained to.

    Args:
        folder: with `tokenizer.json`, and maybe `tokenizer_config.json`.

    Raises:
        FileMissing: If there is no `tokenizer.json`.
        FormatError: If a file cannot be read.
    """

    def __init__(self, folder: Path) -> None:
        path = folder / "tokenizer.json"
        if not path.is_file():
            raise FileMissing(f"{path}: the tokenizer of the encoder is missing")
        try:
            self._tokenizer: Any = tokenizers.Tokenizer.from_file(str(path))
        except Exception as error:  # the library raises nothing more special
            raise FormatError(f"is not a tokenizer: {error}", path=path) from None
        settings = _settings(folder / "tokenizer_config.json")
        longest = settings.get("model_max_length")
        self._length: int | None = None
        if isinstance(longest, int | float) and 0 < longest <= _LONGEST:
            self._length = int(longest)
        padding: dict[str, Any] = self._tokenizer.padding or {}
        name = settings.get("pad_token")
        named = self._tokenizer.token_to_id(name) if isinstance(name, str) else None
        pad: int | None = padding.get("pad_id", named)
        self._pad = pad or 0
        self._tokenizer.no_padding()
        self._tokenizer.no_truncation()

    def of(self, text: str, length: int | None = None) -> TokenizedText:
        """Return the tokens of a text.

        Args:
            text: which is cut off where it is too long.
            length: how many tokens the encoder takes; None for any number of them.
        """
        length = length or self._length
        encoded: list[int] = self._tokenizer.encode(text).ids
        if length is None:
            ids = encoded[:_LONGEST]
            return TokenizedText(ids, [1] * len(ids))
        if len(encoded) > length:
            encoded = [*encoded[: length - 1], encoded[-1]]  # the last one is the end of text
        rest = length - len(encoded)
        return TokenizedText(encoded + [self._pad] * rest, [1] * len(encoded) + [0] * rest)


def _settings(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {}
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise FormatError(f"cannot be read: {error}", path=path) from None
    return values if isinstance(values, dict) else {}
