"""What kind of file something is, by its first bytes and never by its name.

Source: the WHATWG standard "MIME Sniffing", for what browsers show; ISO/IEC 11172-3 for MP3.
"""

from __future__ import annotations

OTHER = "application/octet-stream"
"""The media type of all that no browser is asked to show."""

HEAD = 4096
"""Number of first bytes that identify a media type."""

_STARTS = {
    b"\x89PNG\r\n\x1a\n": "image/png",
    b"\xff\xd8\xff": "image/jpeg",
    b"GIF87a": "image/gif",
    b"GIF89a": "image/gif",
    b"ID3": "audio/mpeg",
    b"fLaC": "audio/flac",
    b"%PDF-": "application/pdf",
}
_RIFF = {b"WEBP": "image/webp", b"WAVE": "audio/wav"}
_ENDINGS = {
    "picture": ("png", "jpg", "jpeg", "gif", "webp"),
    "sound": ("wav", "mp3", "ogg", "oga", "opus", "flac", "m4a"),
    "video": ("mp4", "m4v", "webm", "mov", "ogv"),
}
_MARKUP = {b"<!doctype html": "HTML", b"<html": "HTML", b"<svg": "SVG", b"<?xml": "XML"}
_MP3_KBITS = (0, 32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320)
_MP3_RATES = (44100, 48000, 32000)


def media_type_of(head: bytes) -> str:
    r"""Return the media type of a file by its first bytes.

    What could hold a program, such as HTML and SVG, is `OTHER`, as is all that is unknown.

    >>> media_type_of(b"\x89PNG\r\n\x1a\n..."), media_type_of(b"<svg onload='...'>")
    ('image/png', 'application/octet-stream')
    """
    for start, media_type in _STARTS.items():
        if head.startswith(start):
            return media_type
    if head.startswith(b"RIFF"):
        return _RIFF.get(head[8:12], OTHER)
    if head[4:8] == b"ftyp":  # ISO/IEC 14496-12
        return "audio/mp4" if head[8:11] in (b"M4A", b"M4B") else "video/mp4"
    if head.startswith(b"OggS"):
        return "video/ogg" if b"theora" in head[:512] else "audio/ogg"
    if head.startswith(b"\x1a\x45\xdf\xa3") and b"webm" in head[:64]:  # its document type
        return "video/webm"
    return "audio/mpeg" if _is_mp3(head) else OTHER


def claimed_kind(name: str) -> str | None:
    """Return "picture", "sound" or "video" if a file's name says that it is one.

    >>> claimed_kind("tile.JPG"), claimed_kind("plan.svg")
    ('picture', None)
    """
    ending = name.rpartition(".")[2].lower()
    return next((kind for kind, endings in _ENDINGS.items() if ending in endings), None)


def described(head: bytes) -> str:
    """Return what the first bytes of a file that is not a picture, sound or video look like."""
    start = head.lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    for mark, name in _MARKUP.items():
        if start.startswith(mark):
            return name
    return "something else" if head else "empty"


def _is_mp3(head: bytes) -> bool:
    """Return whether two frames of MPEG-1 layer III follow each other."""
    length = _mp3_frame(head)
    return length is not None and _mp3_frame(head[length:]) is not None


def _mp3_frame(head: bytes) -> int | None:
    """Return the length of the frame that bytes begin with; None if they begin with none."""
    if len(head) < 4 or head[0] != 0xFF or head[1] & 0xFE != 0xFA:
        return None
    bits, rate = head[2] >> 4, head[2] >> 2 & 3
    if not 0 < bits < len(_MP3_KBITS) or rate >= len(_MP3_RATES):
        return None
    return 144_000 * _MP3_KBITS[bits] // _MP3_RATES[rate] + (head[2] >> 1 & 1)
