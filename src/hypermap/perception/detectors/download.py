"""Downloads a network: complete and verified, or not at all; interrupted downloads resume."""

from __future__ import annotations

import contextlib
import hashlib
import http.client
import os
import re
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

from hypermap.core.errors import HypermapError
from hypermap.perception.detectors.catalog import KnownNetwork

try:
    import fcntl
except ImportError:  # Windows
    _HAS_LOCKS = False
else:
    _HAS_LOCKS = True

_CHUNK = 65536  # bytes
_SILENCE = 30.0  # seconds without a byte after which a connection counts as broken
_TRIES = 3  # in a row that receive no byte
_OTHER = "name a mirror with --url, or get the file with a browser and give it as --detector FILE"
_LENGTH = re.compile("[0-9]{1,18}")  # in a header; int accepts other digits, too
_BROKEN = (OSError, http.client.HTTPException)

Progress = Callable[[int], None]


class _BrokenOff(Exception):
    """The connection ended before the file did."""


class _OtherFile(Exception):
    """The server's file has another length."""


def download(
    network: KnownNetwork, url: str | None = None, on_progress: Progress = lambda _: None
) -> Path:
    """Put a network's file into the cache, if it is not there, and return it.

    An interrupted download resumes. The file appears when it is complete
    and has the right hash; then it replaces any other file there.

    Args:
        network: what to download.
        url: a mirror (http or https) to use instead of the network's own address.
        on_progress: called with the number of bytes so far, from time to time.

    Raises:
        HypermapError: If it is not at the address, the connection fails, the file is another one,
            or it cannot be written; the message names the remedy.
    """
    address = url or network.url
    if urllib.parse.urlsplit(address).scheme not in ("http", "https"):
        raise HypermapError(f"{address}: expected an address that begins with http:// or https://")
    target = network.path
    if target.is_file() and _hash(target) == network.sha256:
        on_progress(network.size)
        return target
    part = target.with_name(f"{target.name}.part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with part.open("ab+") as file, _locked(file, part):
            _fill(file, network, address, on_progress)
            file.flush()
            os.fsync(file.fileno())
            if not _HAS_LOCKS:  # on Windows, which does not rename open files
                file.close()
            part.replace(target)
    except OSError as error:
        raise HypermapError(
            f"{error.filename or part}: cannot be written: {error.strerror}; XDG_CACHE_HOME may "
            "name another folder"
        ) from None
    return target


def _fill(file: IO[bytes], network: KnownNetwork, address: str, on_progress: Progress) -> None:
    """Write the network to a file; detect and replace a part of another file."""
    had_part = file.seek(0, os.SEEK_END) > 0
    _receive(file, network, address, on_progress)
    found = _hash_of(file)
    if found != network.sha256 and had_part:
        file.truncate(0)
        _receive(file, network, address, on_progress)
        found = _hash_of(file)
    if found != network.sha256:
        size = file.seek(0, os.SEEK_END)
        file.truncate(0)
        raise HypermapError(
            f"{address}: this is not {network.name}: {size} bytes with the SHA-256 {found}, "
            f"expected {network.size} with {network.sha256}; the download was "
            "deleted. A proxy or a mirror may have sent something else"
        )


def _receive(file: IO[bytes], network: KnownNetwork, address: str, on_progress: Progress) -> None:
    """Append what is missing; reconnect while that brings more.

    Return early if the server has another file; the hash will show that.
    """
    tries, have = 0, file.seek(0, os.SEEK_END)
    while have < network.size and tries < _TRIES:
        try:
            _append(file, network.size, address, on_progress)
            return
        except _OtherFile:
            return
        except _BrokenOff as error:
            reason = str(error)
        before, have = have, file.seek(0, os.SEEK_END)
        tries = 0 if have > before else tries + 1
    if tries:
        kept = f"{have} of {network.size} bytes are kept: run the same command to continue, or "
        raise HypermapError(f"{address}: {reason}; {kept if have else ''}{_OTHER}")


def _append(file: IO[bytes], size: int, address: str, on_progress: Progress) -> None:
    """Append what one connection delivers.

    Raises:
        HypermapError: If the server refuses.
        _BrokenOff: If the connection fails or ends early.
    """
    have = file.tell()
    with _asked(address, have) as answer:
        if have and not _goes_on(answer, have):
            file.truncate(0)
            have = 0
        length = answer.headers.get("Content-Length", "")
        if _LENGTH.fullmatch(length) and have + int(length) != size:
            file.write(_read(answer, min(int(length), _CHUNK)))
            raise _OtherFile
        while have < size:
            chunk = _read(answer, min(_CHUNK, size - have))
            if not chunk:
                raise _BrokenOff("the connection was interrupted")
            file.write(chunk)
            have += len(chunk)
            on_progress(have)
    file.flush()


@contextlib.contextmanager
def _asked(address: str, start: int) -> Iterator[Any]:
    """Yield the server's response to a request for all bytes from one on."""
    headers = {"User-Agent": "hypermap", "Accept-Encoding": "identity"}
    if start:
        headers["Range"] = f"bytes={start}-"
    try:
        answer = urllib.request.urlopen(
            urllib.request.Request(address, headers=headers), timeout=_SILENCE
        )
    except urllib.error.HTTPError as error:
        error.close()
        if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            raise _OtherFile from None
        said = f"the server answers {error.code} {error.reason}"
        raise HypermapError(f"{address}: {said}; {_OTHER}") from None
    except urllib.error.URLError as error:
        raise _BrokenOff(f"cannot be reached: {error.reason}") from None
    except (*_BROKEN, ValueError) as error:
        raise _BrokenOff(f"cannot be reached: {error or type(error).__name__}") from None
    with answer:
        yield answer


def _goes_on(answer: Any, start: int) -> bool:
    """Return whether a response is the rest from a byte on, not the whole file."""
    place: str = answer.headers.get("Content-Range", "")
    is_part = bool(answer.status == http.HTTPStatus.PARTIAL_CONTENT)
    return is_part and place.startswith(f"bytes {start}-")


def _read(answer: Any, most: int) -> bytes:
    try:
        return bytes(answer.read(most))
    except _BROKEN as error:
        raise _BrokenOff(
            f"the connection was interrupted: {error or type(error).__name__}"
        ) from None


@contextlib.contextmanager
def _locked(file: IO[bytes], path: Path) -> Iterator[None]:
    """Lock the partial file while the caller fills it, if the system has locks."""
    try:
        if _HAS_LOCKS:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise HypermapError(f"{path}: another process is downloading this already") from None
    yield


def _hash(path: Path) -> str:
    with path.open("rb") as file:
        return _hash_of(file)


def _hash_of(file: IO[bytes]) -> str:
    file.seek(0)
    digest = hashlib.sha256()
    while chunk := file.read(_CHUNK):
        digest.update(chunk)
    return digest.hexdigest()
