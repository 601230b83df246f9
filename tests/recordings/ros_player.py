"""Plays a TUM folder as a live robot would, through rospy: run by a Python that has ROS.

Usage: ros_player.py FOLDER COUNT RECORDERS, which plays the first COUNT pairs of images once so
many recorders listen. Then it says "played" and stays until its standard input ends: who loses a
publisher does not read what is left of it. The intrinsics are those of the benchmark, depth has
5000 units to the meter, and frames are called as in the benchmark's own bags, with leading slashes.
"""

import sys
import time
from pathlib import Path

import numpy as np
import rospy
from geometry_msgs.msg import TransformStamped
from PIL import Image as Picture
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

FRAME = "/openni_rgb_optical_frame"


def read_list(path: Path) -> "list[list[str]]":
    return [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]


def stamped(message, seconds: float, frame: str):
    message.header.stamp = rospy.Time(int(seconds), round(seconds % 1 * 1e6) * 1000)
    message.header.frame_id = frame
    return message


def image(pixels, encoding: str, seconds: float):
    message = stamped(Image(), seconds, FRAME)
    message.height, message.width = pixels.shape[:2]
    message.encoding, message.step = encoding, pixels[0].nbytes
    message.data = np.ascontiguousarray(pixels).tobytes()
    return message


def camera_info(pixels, seconds: float):
    message = stamped(CameraInfo(), seconds, FRAME)
    message.height, message.width = pixels.shape[:2]
    message.K = [525, 0, 319.5, 0, 525, 239.5, 0, 0, 1]
    message.D = [0.0] * 5
    return message


def transform(seconds: float, parent: str, child: str, numbers: "list[float]"):
    message = stamped(TransformStamped(), seconds, parent)
    message.child_frame_id = child
    p, q = message.transform.translation, message.transform.rotation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = numbers
    return TFMessage([message])


def main(folder: Path, count: int, recorders: int) -> None:
    rospy.init_node("player")
    topics = {
        "/tf": TFMessage,
        "/camera/depth/image": Image,
        "/camera/depth/camera_info": CameraInfo,
        "/camera/rgb/image_color": Image,
    }
    publishers = {
        name: rospy.Publisher(name, kind, queue_size=1000) for name, kind in topics.items()
    }
    fixed = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
    fixed.publish(transform(1.0, "/kinect", FRAME, [0, 0, 0, 0, 0, 0, 1]))
    for publisher in (*publishers.values(), fixed):
        while publisher.get_num_connections() < recorders:
            time.sleep(0.05)
    depths, colors = (read_list(folder / name)[:count] for name in ("depth.txt", "rgb.txt"))
    first, last = float(depths[0][0]) - 0.1, float(depths[-1][0]) + 0.1
    poses = [
        transform(float(row[0]), "/world", "/kinect", list(map(float, row[1:])))
        for row in read_list(folder / "groundtruth.txt")
        if first <= float(row[0]) <= last
    ]
    for start in range(0, len(poses), 4):  # `rosbag record` queues 100 messages of a topic
        some = [one for pose in poses[start : start + 4] for one in pose.transforms]
        publishers["/tf"].publish(TFMessage(some))
    for (depth_stamp, depth_name), (color_stamp, color_name) in zip(depths, colors, strict=True):
        integers = np.asarray(Picture.open(folder / depth_name)).astype(np.float32)
        depth = np.where(integers == 0, np.float32("nan"), integers / np.float32(5000))
        color = np.asarray(Picture.open(folder / color_name).convert("RGB"))
        publishers["/camera/depth/image"].publish(image(depth, "32FC1", float(depth_stamp)))
        publishers["/camera/depth/camera_info"].publish(camera_info(depth, float(depth_stamp)))
        publishers["/camera/rgb/image_color"].publish(
            image(color[..., ::-1], "bgr8", float(color_stamp))
        )
        time.sleep(0.1)
    print("played", flush=True)  # noqa: T201 - for the test
    sys.stdin.read()


main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
