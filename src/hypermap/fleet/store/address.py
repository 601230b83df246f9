"""The address of a store: that of a PostgreSQL database, and which site of it is meant."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qsl, quote, urlencode

from hypermap.core.errors import HypermapError

_BEGIN = re.compile(r"^postgres(?:ql)?:(/{1,3})")


class StoreError(HypermapError):
    """A store cannot be reached, or cannot do what was asked of it."""


class StoreAway(StoreError):
    """The database does not answer; it may later."""


class ContentRefused(StoreError):
    """A store will never take this content, though it may take others."""


@dataclass(frozen=True)
class Address:
    """A database, and what of it is meant.

    Attributes:
        database: what libpq connects to; may hold a password, so it is never shown.
        shown: the same without a password.
        site: the name of a site; None for the whole store.
        version: a version of the site; None for the present one.
    """

    database: str
    shown: str
    site: str | None = None
    version: int | None = None

    def __repr__(self) -> str:
        return f"<Address {self.shown}>"

    def at(self, site: str, version: int | None = None) -> Address:
        """Return the address of a site in the same store."""
        return Address(self.database, self.shown, site, version)


def parse_address(text: object) -> Address:
    """Return the address in a text such as "postgresql://robot@db.example/maps?site=lab".

    Everything but `site` and `version` is as libpq has it. A path made of such a text has lost a
    slash, which is put back.

    Raises:
        StoreError: If it is none.

    >>> parse_address("postgresql://me:secret@db.example/maps?site=lab&version=3")
    <Address postgresql://me@db.example/maps?site=lab&version=3>
    """
    given = _with_all_slashes(str(text))
    head, _, query = given.partition("?")
    pairs = parse_qsl(query, keep_blank_values=True)
    ours = {key: value for key, value in pairs if key in ("site", "version")}
    others = [(key, value) for key, value in pairs if key not in ours]
    database = _joined(head, others)
    shown = _joined(without_password(head), [pair for pair in pairs if "password" not in pair[0]])
    if not _can_be_parsed(database):
        raise StoreError(f"{shown}: expected postgresql://USER@HOST/DATABASE?site=SITE")
    version = ours.get("version")
    if version is not None and not re.fullmatch(r"[1-9][0-9]{0,8}", version):
        raise StoreError(f"{shown}: version must be a number from 1 on")
    return Address(
        database, shown, ours.get("site") or None, None if version is None else int(version)
    )


def site_address(text: object) -> Address:
    """Return an address that names a site.

    Raises:
        StoreError: If it does not.
    """
    address = parse_address(text)
    if address.site is None:
        raise StoreError(f"{address.shown}: name a site: ?site=SITE (`hypermap sites` lists them)")
    return address


def without_password(head: str) -> str:
    """Return the part of an address before "?" without a password.

    >>> without_password("postgresql://me:secret@db.example/maps")
    'postgresql://me@db.example/maps'
    """
    return re.sub(r"^(\w+:/+[^:/@]*):[^@]*@", r"\1@", head)


def _with_all_slashes(text: str) -> str:
    match = _BEGIN.match(text)
    if match is None:
        shown = without_password(text.partition("?")[0])
        raise StoreError(
            f"{shown!r} is not the address of a store: postgresql://USER@HOST/DATABASE"
        )
    try:
        text.encode()
    except UnicodeEncodeError:
        raise StoreError("the address of the store is not valid Unicode") from None
    slashes, rest = match[1], text[match.end() :]
    if len(slashes) == 1:
        slashes = "//" if "/" in rest.partition("?")[0] else "///"
    return f"postgresql:{slashes}{rest}"


def _joined(head: str, pairs: list[tuple[str, str]]) -> str:
    return f"{head}?{urlencode(pairs, quote_via=quote, safe='/')}" if pairs else head


def _can_be_parsed(database: str) -> bool:
    psycopg = driver()
    try:
        psycopg.conninfo.conninfo_to_dict(database)
    except (psycopg.ProgrammingError, UnicodeError):
        return False
    return True


def driver() -> Any:
    """Return the module `psycopg`.

    Raises:
        MissingExtra: If it is not installed.
    """
    from hypermap.core.errors import MissingExtra

    try:
        import psycopg
    except ImportError:
        raise MissingExtra("a store in PostgreSQL", "store") from None
    return psycopg
