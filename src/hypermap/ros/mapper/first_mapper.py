"""The semantic mapper with the parameters of the first program: semmapping, of 2019."""

from __future__ import annotations

from collections.abc import Mapping

from hypermap.core.errors import HypermapError
from hypermap.ros.mapper.outputs import PolygonTopics
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.mapper.settings import DARKNET
from hypermap.ros.port import Parameter, Value

_DARKNET_TOPIC = "/darknet_ros/bounding_boxes"
_RENAMED = {"point_cloud": "cloud_topic", "camera_info": "camera_info_topic"}
_LEFT_OUT = {
    "laser_scanner": "what the robot has looked over follows from depth alone",
    "load_file": "every run makes a new map",
    "file": "every run makes a new map",
}


class FirstMapper(SemanticMapper):
    """The node `mapping`: old names of parameters, next to those of today.

    `detector` is `darknet`, its default, or a network in a file (.onnx).
    """

    NAME = "mapping"
    POLYGONS = PolygonTopics(
        shapes=("detected_shape", "detected_pg"),
        areas=("observed_area", "camera_pg", "complete_area_pg"),
    )
    PARAMETERS = (
        *(
            Parameter(
                parameter.name, "darknet", "Darknet's node, or a neural network in a file (.onnx)."
            )
            if parameter.name == "detector"
            else parameter
            for parameter in SemanticMapper.PARAMETERS
        ),
        Parameter("point_cloud", "", "The former name of cloud_topic."),
        Parameter("camera_info", "", "The former name of camera_info_topic."),
        Parameter("laser_scanner", "", "Not heeded: the area seen follows from depth."),
        Parameter("load_file", False, "Not heeded: every run makes a new map."),
        Parameter("file", "", "Not heeded: every run makes a new map."),
    )

    def _read(self) -> dict[str, Value]:
        values = super()._read()
        for old, new in _RENAMED.items():
            if values[old]:
                self._port.log("info", f"{old} is called {new} now")
        for old, why in _LEFT_OUT.items():
            if values[old]:
                self._port.log("warning", f"{old} is not heeded any more: {why}")
        return todays(values)


def todays(values: Mapping[str, Value]) -> dict[str, Value]:
    """Return the values of parameters of 2019 as those of today.

    Raises:
        HypermapError: If the detector is neither darknet nor a file.
    """
    now = dict(values)
    for old, new in _RENAMED.items():
        now[new] = now[new] or now[old]
    detector = str(now["detector"])
    if now["detections_topic"] or now["detections_file"] or detector == "darknet":
        now["detector"] = "" if detector == "darknet" else detector
        if not (now["detections_topic"] or now["detections_file"]):
            now["detections_topic"], now["detections_type"] = _DARKNET_TOPIC, DARKNET
    elif not detector.endswith(".onnx"):
        raise HypermapError(
            f"the detector {detector!r} of 2019 is not known: give darknet, a neural network in a "
            "file (.onnx), or detections_topic"
        )
    return now
