"""Tells questions in other languages, of which none is read."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence

# Words that German, French, Spanish, Portuguese, Italian, Dutch, Polish and Turkish questions can
# hardly do without, and that are rare in English ones.
_TEXT = """
wo ist sind der die das dem ein eine einen einem einer wie viele welche welcher welches wer gibt es
im und oder nicht neben auf unter zwischen zeige mir bitte ich wann hast du alle
où est sont le la les un une des dans sur sous près combien quel quelle quels quelles il qui montre
dónde donde está están el los las una unos cuántas cuántos cuantas cuantos hay qué cuál cerca en
onde estão quantos quantas há qual perto
dov'è dove sono il lo gli quanti quante c'è ci quale quali vicino sul sotto mostra
waar zijn het een hoeveel welke staat liggen naast onder tussen
gdzie jest są ile który która na pod nerede kaç var hangi
"""
_WORDS = frozenset(_TEXT.split())


def is_foreign(unknown: Sequence[str], is_any_known: bool) -> bool:
    """Return whether a question seems to be in another language than English.

    Args:
        unknown: the unknown words of the question.
        is_any_known: whether there are others.

    >>> is_foreign(["wo", "ist", "die", "tasse"], False), is_foreign(["hay"], True)
    (True, False)
    """
    common = sum(word.lower() in _WORDS for word in unknown)
    return common >= (2 if is_any_known else 1) or not all(map(_is_latin, unknown))


def _is_latin(word: str) -> bool:
    letters = (letter for letter in word if letter.isalpha())
    return all(unicodedata.name(letter, "").startswith("LATIN") for letter in letters)
