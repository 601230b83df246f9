"""Masks as files: what nav2's map_server and costmap_filter_info_server load."""

from __future__ import annotations

from pathlib import Path

from hypermap.core.occupancy import OccupancyLayer
from hypermap.formats.grid.pgm import dump_raw
from hypermap.formats.yaml_text import write_yaml
from hypermap.ros.server.zones import Filter


def mask_files(mask: OccupancyLayer, wanted: Filter, yaml_path: Path) -> dict[str, bytes]:
    """Return the files of a mask, by name: NAME.pgm, NAME.yaml and NAME_params.yaml.

    The last holds the parameters of two nodes of nav2, which publish together what the map server
    of ours would: the mask, and how it is to be read.

    Args:
        mask: as `draw` returns it.
        wanted: of which filter.
        yaml_path: path of NAME.yaml, where all are going to lie.

    >>> from hypermap.core.hypermap import Hypermap
    >>> from hypermap.ros.server.zones import draw, keepout_filter
    >>> wanted = keepout_filter(["desk 0.2"])
    >>> list(mask_files(draw(Hypermap(), wanted), wanted, Path("keepout.yaml")))
    ['keepout.pgm', 'keepout.yaml', 'keepout_params.yaml']
    """
    topic = f"/{wanted.name}_mask"
    nodes = {
        f"{wanted.name}_filter_mask_server": {
            "yaml_filename": str(yaml_path.absolute()),
            "topic_name": topic,
            "frame_id": mask.frame_id,
        },
        f"{wanted.name}_costmap_filter_info_server": {
            "type": wanted.type,
            "filter_info_topic": f"/{wanted.name}_filter_info",
            "mask_topic": topic,
            "base": wanted.base,
            "multiplier": wanted.multiplier,
        },
    }
    parameters = {node: {"ros__parameters": values} for node, values in nodes.items()}
    return {
        **dump_raw(mask, yaml_path.stem),
        f"{yaml_path.stem}_params.yaml": write_yaml(parameters),
    }
