"""How well the semantic mapper keeps up with a live camera.

Starts a roscore, the node (`hypermap live`) in a process of its own, held to one core where
`taskset` is there, and a camera that shows a drive through the demo's room: depth as it is, camera
info, tf and detections. Prints what the node says on /diagnostics at the end of each run.

    python benchmarks/live_mapping.py [--rate 10] [--seconds 30] [--core 0] [--runs 3]
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from hypermap.perception.frame import RgbdFrame
from hypermap.simulation import SimulatedRecording, demo_world

DEPTH, INFO, BOXES = "/camera/depth/image_rect", "/camera/depth/camera_info", "/boxes"


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", type=float, default=10.0)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--core", type=int, default=0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--profile", default="default")
    arguments = parser.parse_args()
    recording = SimulatedRecording(demo_world(), rate=arguments.rate)
    frames = []
    for frame in recording.frames():
        if len(frames) == round(arguments.rate * arguments.seconds):
            break
        frames.append(frame)
    print(f"{len(frames)} frames of 320 x 240 at {arguments.rate:g}/s, {arguments.profile}")
    print("run  came/s  looked at/s  median ms  95 % ms  mapped  still  busy  other  CPU %")
    with tempfile.TemporaryDirectory() as folder:
        core = start_roscore(Path(folder))
        try:
            show_runs(frames, arguments, Path(folder))
        finally:
            core.send_signal(signal.SIGINT)
            core.wait()


def show_runs(frames: list[RgbdFrame], arguments: argparse.Namespace, folder: Path) -> None:
    """Show the frames to one node after the other."""
    from hypermap.ros.ros1.libraries import rospy
    from hypermap.ros.ros1.messages import message_class

    rospy.init_node("camera", disable_signals=True)
    kinds = {
        "/tf": "tf2_msgs/TFMessage",
        INFO: "sensor_msgs/CameraInfo",
        DEPTH: "sensor_msgs/Image",
        BOXES: "darknet_ros_msgs/BoundingBoxes",
    }
    publishers = {
        topic: rospy.Publisher(topic, message_class(kind), queue_size=10)
        for topic, kind in kinds.items()
    }
    reports: list[Any] = []
    rospy.Subscriber(
        "/diagnostics", message_class("diagnostic_msgs/DiagnosticArray"), reports.append
    )
    for run in range(1, arguments.runs + 1):
        command = [sys.executable, "-m", "hypermap", "live", "--depth-topic", DEPTH]
        command += ["--detections-topic", BOXES, "--profile", arguments.profile]
        if shutil.which("taskset"):
            command = ["taskset", "-c", str(arguments.core), *command]
        with (folder / "node.log").open("wb") as log:
            node = subprocess.Popen([*command, f"__name:=live{run}"], stderr=log, stdout=log)
        while not all(publisher.get_num_connections() for publisher in publishers.values()):
            time.sleep(0.1)
        used = cpu_seconds(node.pid)
        start = time.monotonic()
        for number, frame in enumerate(frames):
            time.sleep(max(0.0, start + number / arguments.rate - time.monotonic()))
            for topic, message in messages(frame, rospy.Time.now(), message_class).items():
                publishers[topic].publish(message)
        time.sleep(0.3)
        share = (cpu_seconds(node.pid) - used) / (time.monotonic() - start)
        reports.clear()
        while not reports:
            time.sleep(0.1)
        values = {pair.key: pair.value for pair in reports[-1].status[0].values}
        node.send_signal(signal.SIGINT)
        node.wait()
        counts = {k.removeprefix("frames: "): int(v) for k, v in values.items() if ": " in k}
        mapped, still, busy = (counts.pop(k) for k in ("mapped", "camera hardly moved", "busy"))
        print(
            f"{run:3} {values['frames per second']:>7} {values['mapped per second']:>12} "
            f"{values['latency, median [ms]']:>10} {values['latency, 95 % [ms]']:>8} {mapped:7} "
            f"{still:6} {busy:5} {sum(counts.values()):6} {100 * share:6.0f}"
        )


def messages(frame: RgbdFrame, now: Any, message_class: Any) -> dict[str, Any]:
    """Return what a robot says of a frame that it takes now."""

    def new(kind: str) -> Any:
        message = message_class(kind)()
        message.header.stamp, message.header.frame_id = now, "camera"
        return message

    transform = new("geometry_msgs/TransformStamped")
    transform.header.frame_id, transform.child_frame_id = "map", "camera"
    p, q = transform.transform.translation, transform.transform.rotation
    p.x, p.y, p.z = frame.map_T_camera[:3, 3].tolist()
    q.x, q.y, q.z, q.w = Rotation.from_matrix(frame.map_T_camera[:3, :3]).as_quat().tolist()
    info = new("sensor_msgs/CameraInfo")
    info.height, info.width = frame.depth.shape
    info.K = frame.camera.K.ravel().tolist()
    depth = new("sensor_msgs/Image")
    depth.height, depth.width = frame.depth.shape
    depth.encoding, depth.step = "16UC1", 2 * depth.width
    depth.data = np.round(np.nan_to_num(frame.depth) * 1000).astype(np.uint16).tobytes()
    boxes = new("darknet_ros_msgs/BoundingBoxes")
    boxes.image_header = depth.header
    found = frame.detections
    if found is not None:
        for box, name, score in zip(found.xyxy.tolist(), found.names, found.scores, strict=True):
            each = message_class("darknet_ros_msgs/BoundingBox")()
            each.xmin, each.ymin, each.xmax, each.ymax = (round(side) for side in box)
            each.Class, each.probability = name, float(score)
            boxes.bounding_boxes.append(each)
    tf = message_class("tf2_msgs/TFMessage")([transform])
    return {"/tf": tf, INFO: info, DEPTH: depth, BOXES: boxes}


def start_roscore(folder: Path) -> subprocess.Popen[bytes]:
    """Start a roscore on a free port, and tell this process and its children of it."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    os.environ.update(
        ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_HOSTNAME="127.0.0.1", ROS_HOME=str(folder)
    )
    core = subprocess.Popen(["roscore", "-p", str(port)], stdout=subprocess.DEVNULL)
    while True:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                time.sleep(2)
                return core
        time.sleep(0.1)


def cpu_seconds(process: int) -> float:
    """Return the CPU time that a process has used [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
