"""Ways to spoil a file: of any bytes, of text, and within the wrapping of archives and pictures."""

from __future__ import annotations

import base64
import contextlib
import gzip
import io
import json
import random
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from typing import Any

Mutator = Callable[[bytes, random.Random], bytes]

MOST_BYTES = 1 << 16
_PNG = b"\x89PNG\r\n\x1a\n"
_NUMBERS = [b"0", b"-1", b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"1e-320", b"1e9", b"-0.0"]
_NUMBERS += [
    b"9999999999999999999",
    b"4294967296",
    b"2147483648",
    b"0.1",
    b"1" * 5000,
    b"1" * 400,
    b"http://[",
]
_WORDS = [b"", b"null", b"true", b"~", b"[]", b"{}", b'""', b"\x00", b"\xff\xfe", b"\xed\xa0\x80"]
_WORDS += ["Ärger\u202e".encode(), b"../../x", b"/dev/null", b"POLYGON EMPTY", b"POLYGON(())"]
_WORDS += [b"!!python/object:os.system", b"&a", b"*a", b"<<", b"[" * 200, b"\\ud800"]


def mutate_bytes(data: bytes, draw: random.Random) -> bytes:
    """Change a few places of any bytes."""
    spoiled = bytearray(data)
    for _ in range(draw.choice([1, 1, 1, 2, 4, 16])):
        at = draw.randrange(len(spoiled) + 1)
        kind = draw.randrange(8)
        if kind == 0 and spoiled:
            spoiled[min(at, len(spoiled) - 1)] ^= 1 << draw.randrange(8)
        elif kind == 1 and spoiled:
            spoiled[min(at, len(spoiled) - 1)] = draw.randrange(256)
        elif kind == 2:
            del spoiled[at : at + draw.choice([1, 2, 4, 8, 64, 1024])]
        elif kind == 3:
            start, length = draw.randrange(len(spoiled) + 1), draw.choice([1, 4, 16, 256])
            spoiled[at:at] = spoiled[start : start + length]
        elif kind == 4:
            spoiled[at:at] = draw.choice(_WORDS + _NUMBERS)
        elif kind == 5:
            number = draw.choice([0, 1, 0x7FFFFFFF, 0xFFFFFFFF, 0x80000000, 0xFFFF, 1 << 20])
            packed = struct.pack(draw.choice("<>") + "I", number)
            spoiled[at : at + 4] = packed
        elif kind == 6:
            value = draw.choice([float("nan"), float("inf"), 1e308, -1e300, 1e-320, 1e12, 0.0])
            spoiled[at : at + 8] = struct.pack("<d", value)
        else:
            spoiled[at:at] = draw.randbytes(draw.choice([1, 2, 8]))
    return bytes(spoiled[:MOST_BYTES])


def mutate_text(data: bytes, draw: random.Random) -> bytes:
    """Change numbers and words of a text, or move its lines and parts."""
    spoiled = data
    for _ in range(draw.choice([1, 1, 2, 3, 6])):
        kind = draw.randrange(6)
        if kind <= 1:
            spoiled = _replaced_run(spoiled, draw, b"0123456789.+-eE", draw.choice(_NUMBERS))
        elif kind == 2:
            letters = b"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_"
            spoiled = _replaced_run(spoiled, draw, letters, draw.choice(_WORDS + _NUMBERS))
        elif kind == 3:
            lines = spoiled.split(b"\n")
            one, other = draw.randrange(len(lines)), draw.randrange(len(lines))
            if draw.random() < 0.3:
                del lines[one]
            elif draw.random() < 0.5:
                lines.insert(one, lines[other])
            else:
                lines[one], lines[other] = lines[other], lines[one]
            spoiled = b"\n".join(lines)
        elif kind == 4:
            start, end = sorted(draw.randrange(len(spoiled) + 1) for _ in range(2))
            times = draw.choice([2, 2, 3, 50])
            repeated = spoiled[start : min(end, start + 200)] * times
            spoiled = spoiled[:start] + repeated + spoiled[end:]
        else:
            spoiled = mutate_bytes(spoiled, draw)
    return spoiled[:MOST_BYTES]


def _replaced_run(data: bytes, draw: random.Random, letters: bytes, new: bytes) -> bytes:
    """Put something in place of a run of letters, found from a random place on."""
    start = draw.randrange(len(data) + 1)
    while start < len(data) and data[start] not in letters:
        start += 1
    end = start
    while end < len(data) and data[end] in letters:
        end += 1
    return data[:start] + new + data[end:]


_ODD: list[Any] = [None, True, False, 0, -1, 1.5, 1e308, -1e308, 1e-320, 10**400, 2**31, 2**63]
_ODD += [float("nan"), float("inf"), float("-inf"), 1e9, 1e12, "", "x", "\0", "\ud800", "a" * 400]
_ODD += ["1", "map", "=1+1", "../x", "2026-11-26T10:00:00Z", [], {}, [[]], [None], [1e308] * 4]
_ODD += [{"type": "Polygon", "coordinates": []}, {"type": "Point", "coordinates": [1, 2]}]


def mutate_json(data: bytes, draw: random.Random) -> bytes:
    """Change one value of a JSON text and leave the rest valid, also within packed texts in it."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return mutate_text(data, draw)
    if draw.random() < 0.1:
        return mutate_text(data, draw)
    for _ in range(draw.choice([1, 1, 1, 2, 3])):
        tree = _with_one_changed(tree, draw)
    try:
        return json.dumps(tree).encode()[:MOST_BYTES]
    except (ValueError, RecursionError):  # a number of too many digits, or too deep
        return mutate_text(data, draw)


def _with_one_changed(tree: Any, draw: random.Random) -> Any:
    """Return a tree of values with one changed, at any depth."""
    if isinstance(tree, (dict, list)) and tree and draw.random() < 0.85:
        keys: list[Any] = list(tree) if isinstance(tree, dict) else list(range(len(tree)))
        key, changed = draw.choice(keys), tree.copy()
        kind = draw.random()
        if kind < 0.08:
            del changed[key]
        elif kind < 0.14 and isinstance(changed, list):
            changed[key:key] = [changed[key]] * draw.choice([1, 2, 100])
        elif kind < 0.14:
            changed[draw.choice([*keys, "x", ""])] = changed[key]
        elif kind < 0.2:
            changed[key] = changed[draw.choice(keys)]
        else:
            changed[key] = _with_one_changed(changed[key], draw)
        return changed
    if isinstance(tree, str) and len(tree) > 40 and draw.random() < 0.9:
        return _packed_text_changed(tree, draw)
    if isinstance(tree, (int, float)) and draw.random() < 0.4:
        return draw.choice([-tree, tree + 1, tree - 1, tree * 1000, bool(tree), [tree]])
    return draw.choice(_ODD)


def _packed_text_changed(text: str, draw: random.Random) -> str:
    """Change what a text holds: JSON, or bytes in base64 that may be compressed."""
    if text[:1] in "{[":
        return mutate_json(text.encode(errors="replace"), draw).decode(errors="replace")
    with contextlib.suppress(ValueError, OSError, EOFError, zlib.error):
        content = base64.b64decode(text, validate=True)
        if content.startswith(b"\x1f\x8b"):
            packed = gzip.compress(mutate_any(gzip.decompress(content), draw), mtime=0)
        elif content.startswith(b"\x78"):
            packed = zlib.compress(mutate_bytes(zlib.decompress(content), draw))
        else:
            packed = mutate_any(content, draw)
        return base64.b64encode(packed).decode()
    return mutate_text(text.encode(errors="replace"), draw).decode(errors="replace")


def mutate_parquet(data: bytes, draw: random.Random) -> bytes:
    """Change a value, a type, a column or what the file says of itself, in a valid Parquet file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if draw.random() < 0.1:
        return mutate_bytes(data, draw)
    try:
        table = pq.read_table(io.BytesIO(data))
    except Exception:  # it is spoiled already
        return mutate_bytes(data, draw)
    for _ in range(draw.choice([1, 1, 2])):
        with contextlib.suppress(pa.ArrowException, OverflowError, ValueError, TypeError):
            table = _table_changed(table, draw)
    packed = io.BytesIO()
    try:
        pq.write_table(table, packed, compression=draw.choice(["none", "snappy", "zstd"]))
    except Exception:  # not all types can be written
        return mutate_bytes(data, draw)
    return packed.getvalue()[:MOST_BYTES]


def _table_changed(table: Any, draw: random.Random) -> Any:
    import pyarrow as pa

    kind, number = draw.random(), draw.randrange(max(table.num_columns, 1))
    if kind < 0.25:  # what the file says of itself
        said = dict(table.schema.metadata or {})
        key = draw.choice(list(said) or [b"geo"])
        said[key] = mutate_json(said.get(key, b"{}"), draw)
        return table.replace_schema_metadata(said)
    if kind < 0.35:
        return table.remove_column(number)
    if kind < 0.45:
        rows = [draw.randrange(max(table.num_rows, 1)) for _ in range(draw.choice([0, 1, 2, 300]))]
        return table.take(rows)
    field, values = table.field(number), table.column(number).to_pylist()
    if kind < 0.6:  # of another type
        kinds = [pa.string(), pa.float32(), pa.int8(), pa.uint64(), pa.binary(), pa.bool_()]
        kinds += [pa.list_(pa.string()), pa.timestamp("ns"), pa.null(), pa.large_binary()]
        return table.set_column(number, field.name, table.column(number).cast(draw.choice(kinds)))
    at = draw.randrange(max(len(values), 1))
    if kind < 0.75:
        values[at] = None
    elif isinstance(values[at], bytes):
        values[at] = mutate_bytes(values[at], draw)
    elif isinstance(values[at], str):
        values[at] = mutate_any(values[at].encode(), draw).decode(errors="ignore")
    else:
        values[at] = _with_one_changed(values[at], draw)
    return table.set_column(number, field, pa.array(values, field.type))


def mutate_archive(data: bytes, draw: random.Random) -> bytes:
    """Change a member of a zip archive, and pack it again; now and then the archive's own bytes."""
    if draw.random() < 0.2:
        return mutate_bytes(data, draw)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {info.filename: archive.read(info) for info in archive.infolist()}
    except Exception:  # it is spoiled already
        return mutate_bytes(data, draw)
    if not members:
        return mutate_bytes(data, draw)
    name = draw.choice(list(members))
    members[name] = mutate_any(members[name], draw)
    if draw.random() < 0.1:
        members[draw.choice(["", "x", "../x", "a/b", "\ud800", "hmap_config.yaml"])] = b"[]"
    packed = io.BytesIO()
    try:
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for member, content in members.items():
                archive.writestr(zipfile.ZipInfo(member), content)
    except (ValueError, UnicodeError):
        return mutate_bytes(data, draw)
    return packed.getvalue()


def mutate_png(data: bytes, draw: random.Random) -> bytes:
    """Change the header or the pixels of a PNG, with check sums that are right."""
    chunks = _chunks(data)
    if not chunks or draw.random() < 0.2:
        return mutate_bytes(data, draw)
    number = draw.randrange(len(chunks))
    kind, content = chunks[number]
    if kind == b"IDAT" and draw.random() < 0.7:
        try:
            content = zlib.compress(mutate_bytes(zlib.decompress(content), draw))
        except zlib.error:
            content = mutate_bytes(content, draw)
    elif kind == b"IHDR" and draw.random() < 0.7:
        sizes = [0, 1, 2, 255, 256, 65535, 1 << 20, (1 << 31) - 1]
        fields = list(struct.unpack(">IIBBBBB", content.ljust(13, b"\0")[:13]))
        place = draw.randrange(7)
        fields[place] = draw.choice(sizes) if place < 2 else draw.randrange(256)
        if draw.random() < 0.5:
            fields[2], fields[3] = draw.choice([1, 2, 4, 8, 16]), draw.choice([0, 2, 3, 4, 6])
        content = struct.pack(">IIBBBBB", *fields)
    else:
        content = mutate_bytes(content, draw)
    chunks[number] = kind, content
    if draw.random() < 0.2:
        chunks.insert(number, draw.choice(chunks))
    return _PNG + b"".join(
        struct.pack(">I", len(content))
        + kind
        + content
        + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    )


def mutate_jpeg(data: bytes, draw: random.Random) -> bytes:
    """Change a segment of a JPEG, or repeat, move or remove it; lengths stay right."""
    segments = _segments(data)
    if not segments or draw.random() < 0.2:
        return mutate_bytes(data, draw)
    number = draw.randrange(len(segments))
    marker, content, scan = segments[number]
    kind = draw.randrange(6)
    if kind == 0 and 0xC0 <= marker <= 0xCF and len(content) > 4:  # of the frame: its size
        sizes = [struct.pack(">H", draw.choice([0, 1, 8, 4000, 8000, 65535])) for _ in range(2)]
        segments[number] = marker, content[:1] + b"".join(sizes) + content[5:], scan
    elif kind == 1:
        segments[number:number] = segments[number : number + 1] * draw.choice([1, 3, 300])
    elif kind == 2:
        segments.insert(draw.randrange(len(segments)), segments.pop(number))
    elif kind == 3:
        segments[number] = draw.choice([0xC0, 0xC2, 0xC4, 0xDA, 0xDB, 0xE1]), content, scan
    elif scan and kind == 4:
        segments[number] = marker, content, mutate_bytes(scan, draw)
    else:
        segments[number] = marker, mutate_bytes(content, draw)[:65533], scan
    parts = [
        struct.pack(">BBH", 0xFF, marker, len(content) + 2) + content + scan
        for marker, content, scan in segments
    ]
    return (b"\xff\xd8" + b"".join(parts) + b"\xff\xd9")[:MOST_BYTES]


def _segments(data: bytes) -> list[tuple[int, bytes, bytes]]:
    """Return the segments of a JPEG: marker, content, and the scan that follows it."""
    found, at = [], 2
    while data.startswith(b"\xff\xd8") and at + 4 <= len(data) and data[at] == 0xFF:
        marker, length = data[at + 1], int.from_bytes(data[at + 2 : at + 4], "big")
        end = at + 2 + max(length, 2)
        scan_end = end
        while marker == 0xDA and scan_end < len(data) - 1:
            if data[scan_end] == 0xFF and data[scan_end + 1] not in (0, *range(0xD0, 0xD8)):
                break
            scan_end += 1
        found.append((marker, data[at + 4 : end], data[end:scan_end]))
        at = scan_end
    return found


def _chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    found, at = [], len(_PNG)
    while data.startswith(_PNG) and at + 12 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        found.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
        at += 12 + length
    return found


def mutate_any(data: bytes, draw: random.Random) -> bytes:
    """Change a file by the way that fits what it is."""
    if data.startswith(b"PK"):
        return mutate_archive(data, draw)
    if data.startswith(_PNG):
        return mutate_png(data, draw)
    if data.startswith(b"\xff\xd8\xff"):
        return mutate_jpeg(data, draw)
    if data.startswith(b"PAR1"):
        return mutate_parquet(data, draw)
    if b"\0" in data[:200]:
        return mutate_bytes(data, draw)
    if data[:1] in (b"{", b"["):
        return mutate_json(data, draw)
    return mutate_text(data, draw)


def mutate_parts(data: bytes, draw: random.Random) -> bytes:
    """Change one of several files that stand in one text; see `joined`."""
    parts = parted(data)
    if not parts:
        return mutate_bytes(data, draw)
    name = draw.choice(list(parts))
    if draw.random() < 0.03:
        del parts[name]
    else:
        parts[name] = mutate_any(parts[name], draw)
    return joined(parts)


def joined(parts: dict[str, bytes]) -> bytes:
    """Return several files as one, for a fuzzer that knows one alone."""
    return b"".join(
        struct.pack("<HI", len(name.encode()), len(content)) + name.encode() + content
        for name, content in parts.items()
    )


def parted(data: bytes) -> dict[str, bytes]:
    """Return the files of `joined`; what is spoiled is cut short."""
    parts: dict[str, bytes] = {}
    at = 0
    while at + 6 <= len(data):
        letters, length = struct.unpack_from("<HI", data, at)
        at += 6
        name = data[at : at + letters].decode(errors="replace")
        at += letters
        parts[name] = data[at : at + length]
        at += length
    return parts


def crossed(data: bytes, others: Sequence[bytes], draw: random.Random) -> bytes:
    """Return the beginning of one file and the end of another."""
    other = draw.choice(others)
    return (data[: draw.randrange(len(data) + 1)] + other[draw.randrange(len(other) + 1) :])[
        :MOST_BYTES
    ]
