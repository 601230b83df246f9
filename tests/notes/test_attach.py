from __future__ import annotations

import io
import wave
import zlib
from pathlib import Path

import pytest
from PIL import Image

from hypermap import FileMissing, HypermapError
from hypermap.core.notes_layer import INSIDE_UP_TO
from hypermap.notes import attachment_of, attachment_of_bytes
from hypermap.notes.attach import may_be_shown
from hypermap.notes.media_types import media_type_of


def picture(form: str, size: tuple[int, int] = (40, 30)) -> bytes:
    content = io.BytesIO()
    Image.effect_noise(size, 50).convert("RGB").save(content, form)
    return content.getvalue()


def sound() -> bytes:
    content = io.BytesIO()
    with wave.open(content, "wb") as file:
        file.setparams((1, 2, 8000, 0, "NONE", ""))
        file.writeframes(bytes(800))
    return content.getvalue()


MP3_FRAME = b"\xff\xfb\x90\x00" + bytes(413)  # 128 kbit/s at 44.1 kHz: 417 bytes


@pytest.mark.parametrize(
    ("content", "kind", "media_type"),
    [
        (picture("PNG"), "picture", "image/png"),
        (picture("JPEG"), "picture", "image/jpeg"),
        (picture("GIF"), "picture", "image/gif"),
        (picture("WEBP"), "picture", "image/webp"),
        (sound(), "sound", "audio/wav"),
        (MP3_FRAME * 3, "sound", "audio/mpeg"),
        (b"OggS" + bytes(24) + b"\x01vorbis", "sound", "audio/ogg"),
        (b"OggS" + bytes(24) + b"\x80theora", "video", "video/ogg"),
        (b"\0\0\0\x20ftypisom" + bytes(20), "video", "video/mp4"),
        (b"\0\0\0\x20ftypM4A " + bytes(20), "sound", "audio/mp4"),
        (b"\x1a\x45\xdf\xa3\x9f\x42\x82\x84webm", "video", "video/webm"),
        (b"%PDF-1.7", "file", "application/pdf"),
        (b"<svg onload='alert(1)'/>", "file", "application/octet-stream"),
        (b"<!DOCTYPE html><script>", "file", "application/octet-stream"),
        (b"\xff\xfbno frame follows", "file", "application/octet-stream"),
        (b"plain", "file", "application/octet-stream"),
    ],
)
def test_the_kind_is_found_in_the_content_whatever_the_name(content, kind, media_type):
    found = attachment_of_bytes(content, "some.thing")
    assert (found.kind, found.media_type) == (kind, media_type)


def test_only_pictures_sounds_and_videos_may_be_shown():
    assert may_be_shown(attachment_of_bytes(picture("PNG"), "a"))
    assert may_be_shown(attachment_of_bytes(sound(), "a"))
    for content in (b"%PDF-1.7", b"<svg/>", b"<html>"):
        assert not may_be_shown(attachment_of_bytes(content, "a"))


def test_a_page_that_begins_like_a_picture_later_is_none():
    assert media_type_of(b"<html>" + picture("PNG")) == "application/octet-stream"


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("fake.png", b"<html><script>", "says that it is a picture, but its content is HTML"),
        ("fake.jpg", b"  <?xml version='1.0'?><svg>", "picture, but its content is XML"),
        ("tune.mp3", b"MZ program", "says that it is a sound, but its content is something else"),
        ("film.mp4", b"plain text", "says that it is a video"),
        ("half.jpg", picture("JPEG")[:400], "half.jpg: the picture is damaged"),
        ("half.png", picture("PNG")[:400], "half.png: the picture is damaged"),
        (
            "head.jpg",
            b"\xff\xd8\xff" + b"x" * 99,
            "head.jpg: the picture is damaged: its header cannot",
        ),
        ("none.txt", b"", "none.txt: is empty"),
    ],
)
def test_a_file_that_is_not_what_it_says_is_refused(name, content, said):
    with pytest.raises(HypermapError, match=said):
        attachment_of_bytes(content, name)


def test_a_picture_that_would_fill_the_memory_is_refused_before_it_is_unpacked():
    header = picture("PNG")
    width, height = (30_000).to_bytes(4, "big"), (30_000).to_bytes(4, "big")
    chunk = b"IHDR" + width + height + header[24:29]
    bomb = header[:12] + chunk + zlib.crc32(chunk).to_bytes(4, "big") + header[33:]
    with pytest.raises(HypermapError, match="more than 64 megapixels"):
        attachment_of_bytes(bomb, "bomb.png")


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("../../etc/passwd", "passwd"),
        ("C:\\photos\\tile 1.txt", "tile 1.txt"),
        ("two\nlines\x1b[31m", "two lines [31m"),
        ("", "file"),
        ("é" * 300, "é" * 200),
    ],
)
def test_a_name_is_one_line_and_no_path(name, kept):
    assert attachment_of_bytes(b"x", name).name == kept


def test_a_small_file_is_read_and_a_large_one_stays_where_it_is(tmp_path: Path):
    small, large = tmp_path / "a.log", tmp_path / "b.log"
    small.write_bytes(b"x" * 10)
    large.write_bytes(b"x" * (INSIDE_UP_TO + 1))
    assert attachment_of(small).content == b"x" * 10
    found = attachment_of(large)
    assert found.content == large
    assert (found.name, found.size) == ("b.log", INSIDE_UP_TO + 1)


def test_what_is_no_file_is_refused(tmp_path: Path):
    with pytest.raises(FileMissing, match="no such file"):
        attachment_of(tmp_path / "none")
    with pytest.raises(HypermapError, match=r"regular file|directory"):
        attachment_of(tmp_path)
