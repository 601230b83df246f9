"""`hypermap view MAP --html`: the page with its map in one file that needs no server."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.value_layer import ValueLayer
from hypermap.formats.atomic import write_file
from hypermap.viewer.live.attached import embed_notes
from hypermap.viewer.live.description import describe_map
from hypermap.viewer.live.embedded_evidence import embed_evidence
from hypermap.viewer.live.embedded_raster import MAX_PIXELS, EmbeddedRaster, embed_raster
from hypermap.viewer.live.embedded_shapes import embed_shapes
from hypermap.viewer.live.layers import LayerViews
from hypermap.viewer.live.measured_values import describe_values
from hypermap.viewer.live.page import PAGE, not_built

_STYLE = '<link rel="stylesheet" href="page/app.css">'
_SCRIPT = '<script type="module" src="page/app.js"></script>'
_BLOB = "<!-- hypermap:blob -->"
_HEAD = "<!-- hypermap:head -->"


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes:
        size: of the file [bytes].
        notes: what the reader should know of it, as which layer had to be reduced.
    """

    size: int
    notes: tuple[str, ...]


def export_page(
    hypermap: Hypermap,
    map_path: str | Path,
    path: str | Path,
    *,
    page: Path = PAGE,
    max_pixels: int = MAX_PIXELS,
) -> Exported:
    """Write a map as one HTML file that works from disk, without any network.

    The same map gives the same file. It is replaced as a whole or not at all.

    Args:
        hypermap: the map.
        map_path: where it was opened; the page names the file, not its folder.
        path: where to save.
        page: the folder of the built page: index.html, app.js and app.css.
        max_pixels: how many pixels the picture of a layer may have; larger grids are reduced.

    Raises:
        HypermapError: If the page is not built, or the file cannot be written.
    """
    blob, notes = _blob(hypermap, Path(map_path), max_pixels)
    content = _document(page, blob).encode()
    write_file(path, content)
    return Exported(len(content), notes)


def _blob(
    hypermap: Hypermap, map_path: Path, max_pixels: int
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return what the page reads instead of the server's answers, and notes about it."""
    rasters: dict[str, Any] = {}
    shapes: dict[str, Any] = {}
    values: dict[str, Any] = {}
    evidence: dict[str, Any] = {}
    notes: list[str] = []
    views = LayerViews()
    for layer in hypermap:
        view = views.of(hypermap, layer)
        if view.problem:
            notes.append(f"layer {layer.name!r} is not shown: {view.problem}")
            continue
        raster = embed_raster(layer, view.base_T_layer, max_pixels)
        if raster is not None:
            rasters[layer.name] = raster.as_json()
            notes += _notes(layer.name, raster)
        if isinstance(layer, ValueLayer):
            sent = describe_values(layer, view.base_T_layer)
            values.update({layer.name: sent} if sent else {})
        embedded = embed_shapes(layer, view.base_T_layer)
        if embedded is not None:
            shapes[layer.name] = embedded
        behind, note = embed_evidence(hypermap, layer)
        evidence.update({layer.name: behind} if behind else {})
        notes += [note] if note else []
    described = describe_map(hypermap, views, is_editable=False)
    still = {"version": 0, "can_undo": False, "can_redo": False, "unsaved": False}
    notes += described.get("notes", [])
    shown = {"name": map_path.name, "path": map_path.name, **still, **described, "notes": notes}
    parts = {"rasters": rasters, "shapes": shapes, "values": values, "evidence": evidence}
    noted = embed_notes(hypermap)
    return {"version": 1, "map": shown, **parts, "notes": noted}, tuple(notes)


def _notes(name: str, raster: EmbeddedRaster) -> list[str]:
    if raster.reduced_by == 1:
        return []
    side = raster.reduced_by
    return [
        f"layer {name!r} is reduced: {side} x {side} of its cells are one here, "
        "which has their highest value"
        if raster.says
        else f"layer {name!r} is reduced: one of {side} x {side} of its cells is shown"
    ]


def _document(page: Path, blob: Mapping[str, Any]) -> str:
    """Return the page with its style, its script and the map inside."""
    html, style, script = (_read(page / name) for name in ("index.html", "app.css", "app.js"))
    script = _inline_script(script)
    if "</style" in style.lower():
        raise HypermapError(f"{page / 'app.css'}: a style that ends itself cannot be inlined")
    policy = (
        f"default-src 'none'; script-src {_digest(script)}; style-src {_digest(style)}; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    parts = {
        _HEAD: f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        _STYLE: f"<style>{style}</style>",
        _BLOB: f'<script type="application/json" id="hypermap-blob">{_json(blob)}</script>',
        _SCRIPT: f'<script type="module">{script}</script>',
    }
    for place in parts:
        if html.count(place) != 1:
            raise HypermapError(f"{page / 'index.html'}: this must stand there once: {place}")
    places = "|".join(map(re.escape, parts))
    return re.sub(places, lambda found: parts[found.group()], html)  # in one go: parts stay as is


def _digest(text: str) -> str:
    """Return how a content security policy names an inline script or style."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _inline_script(script: str) -> str:
    """Return JavaScript that ends no script element; both stand in text and patterns alone."""
    return script.replace("</script", r"<\/script").replace("<!--", r"<\!--")


def _json(value: Any) -> str:
    """Return JSON that cannot end the script element around it, whatever the names are."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", r"\u003c").replace(">", r"\u003e").replace("&", r"\u0026")


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise HypermapError(not_built(path)) from None
