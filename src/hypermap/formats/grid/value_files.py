"""Value layers as files. The specification is docs/formats/values.md."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from hypermap.core.errors import FormatError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import RESOLUTIONS, GridGeometry
from hypermap.core.layer import Store
from hypermap.core.samples import Samples
from hypermap.core.value_layer import ValueLayer
from hypermap.formats import limits
from hypermap.formats.checked import Checked, Finite, Pose, check
from hypermap.formats.grid.npy import dump_npy, parse_npy
from hypermap.formats.yaml_text import read_yaml, write_yaml

_CELLS, _STAMPS, _SAMPLES = "<f4", "<f8", "<f8"
_COLUMNS = 5  # of samples: x, y, value, whether it is a limit, stamp
_MOST_DECIMALS = 9
_TEXTS = {("unit",), ("quantity",)}


class _About(Checked):
    """The content of the YAML file, which describes the arrays."""

    resolution: Annotated[Finite, Field(ge=RESOLUTIONS[0], le=RESOLUTIONS[1])]
    origin: Pose
    unit: str = ""
    decimals: Annotated[int, Field(ge=0, le=_MOST_DECIMALS)] = 1
    quantity: str = ""
    holds: tuple[Literal["deviations", "stamps", "samples"], ...] = ()
    made_by: dict[str, bool | int | Finite | str] = Field(default_factory=dict)


class ValueFiles:
    """The files of value layers: `file` NAME means NAME.yaml, NAME.npy and what NAME.yaml names."""

    def empty(self, name: str, frame_id: str, settings: Mapping[str, Any]) -> ValueLayer:
        """Return a layer without cells."""
        return ValueLayer(name, frame_id, settings=settings)

    def load(
        self, store: Store, file: str, name: str, frame_id: str, settings: Mapping[str, Any]
    ) -> ValueLayer:
        """Return the layer.

        Raises:
            FormatError: If one of its files is missing or wrong.
        """
        path = store.path_of(f"{file}.yaml")
        about = check(_About, read_yaml(store.read(f"{file}.yaml"), path, _TEXTS), path)

        def array(part: str, dtype: str) -> NDArray[Any]:
            member = f"{file}.{part}"
            return parse_npy(store.read(member), dtype, store.path_of(member))

        cells = array("npy", _CELLS)
        kept: dict[str, Any] = {}
        if "deviations" in about.holds:
            kept["deviations"] = array("deviations.npy", _CELLS)
        if "stamps" in about.holds:
            kept["stamps"] = array("stamps.npy", _STAMPS)
        if "samples" in about.holds:
            columns = array("samples.npy", _SAMPLES)
            kept["samples"] = _samples(columns, store.path_of(f"{file}.samples.npy"))
        try:
            height, width = cells.shape
            grid = GridGeometry(width, height, about.resolution, Pose2D(*about.origin))
            return ValueLayer(
                name,
                frame_id,
                grid,
                cells,
                about.unit,
                about.decimals,
                quantity=about.quantity,
                **kept,
                made_by=about.made_by,
                settings=settings,
            )
        except ValueError as error:
            raise FormatError(str(error), path=path) from None

    def save(self, layer: ValueLayer, store: Store, file: str) -> None:
        """Write the layer's files; a layer without cells needs none."""
        if layer.grid is None or layer.cells is None:
            return
        store.write(f"{file}.npy", dump_npy(layer.cells, _CELLS))
        holds = []
        for name, dtype in (("deviations", _CELLS), ("stamps", _STAMPS)):
            numbers = getattr(layer, name)
            if numbers is not None:
                store.write(f"{file}.{name}.npy", dump_npy(numbers, dtype))
                holds.append(name)
        if layer.samples is not None:
            store.write(f"{file}.samples.npy", dump_npy(_columns(layer.samples), _SAMPLES))
            holds.append("samples")
        origin = layer.grid.origin
        about = {
            "quantity": layer.quantity,
            "unit": layer.unit,
            "decimals": layer.decimals,
            "resolution": layer.grid.resolution,
            "origin": [origin.x, origin.y, origin.yaw],
            "holds": holds,
            "made_by": layer.made_by,
        }
        store.write(f"{file}.yaml", write_yaml(about))


PLUGIN = ValueFiles()


def _columns(samples: Samples) -> NDArray[np.float64]:
    columns = (samples.points_xy, samples.values, samples.is_below, samples.stamps)
    return np.column_stack(columns).astype(np.float64)


def _samples(columns: NDArray[np.float64], path: str) -> Samples:
    if columns.shape[1] != _COLUMNS:
        raise FormatError(f"has {columns.shape[1]} columns, not {_COLUMNS}", path=path)
    x, y, values, is_below, stamps = columns.T
    try:
        if not (np.abs(columns[:, :2]) <= limits.MAX_PLACE).all():
            raise ValueError(f"a sample is farther away than {limits.MAX_PLACE:g} m")
        if not np.isin(is_below, (0, 1)).all():
            raise ValueError("the column for censored values must be 0 or 1")
        return Samples.of(np.column_stack([x, y]), values, is_below, stamps)
    except ValueError as error:
        raise FormatError(str(error), path=path) from None
