"""Size limits of a map's files, checked before memory is allocated.

They are far above any map of a building, and far below what fills a robot's memory.
"""

from __future__ import annotations

MIB = 1 << 20

MAX_FILE_BYTES = 512 * MIB
"""One file of a map, unpacked."""

MAX_ARCHIVE_BYTES = 1024 * MIB
"""All files of an archive together, unpacked."""

MAX_MEMBERS = 10_000
"""Files in an archive, or of one layer in a folder."""

MAX_COMPRESSION = 200
"""Unpacked size over packed size, for members of more than `SMALL_FILE_BYTES`."""

SMALL_FILE_BYTES = 1 * MIB

MAX_CELLS = 1 << 27
"""Cells of all grids of a map: 134 million, or a square of 579 m at 5 cm, unless `grid.budget`
finds a setting."""

MAX_YAML_BYTES = 64 * MIB

MAX_YAML_VALUES = 5_000_000
"""Values in a YAML file, with aliases counted as often as they are used."""

MAX_YAML_DEPTH = 64

MAX_ROWS = 10_000_000
"""Objects in a GeoParquet file."""

MAX_COLUMNS = 200
"""Columns of a GeoParquet file."""

MAX_TABLE_BYTES = 1024 * MIB
"""A GeoParquet file, unpacked."""

MAX_EVIDENCE_BYTES = 64 * MIB
"""The evidence behind a semantic layer; of more, none is kept."""

MAX_PICTURES_BYTES = 256 * MIB
"""Size of all pictures of the objects of a layer."""

MAX_NOTES_BYTES = 64 * MIB
"""The texts of a layer of notes."""

MAX_ATTACHED_INSIDE = 256 * MIB
"""Size of all files attached to the notes of a layer within an archive; more are next to it."""

MAX_ATTACHED_MEMBERS = 2000
"""How many of them are within an archive."""

MAX_EMBEDDINGS_BYTES = 1024 * MIB
"""Size of the embeddings of the objects of a layer; of more, none are kept."""

MAX_PLACE = 1e9
"""Meters from the origin of a frame; farther out, cells and outlines have no room in a number."""

MAX_INTEGER_LETTERS = 1000
"""Of a whole number in YAML; Python writes no more than 4300 digits."""
