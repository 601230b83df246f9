#!/bin/sh
# Install ROS 1 from Debian 12, as root; elsewhere say why not, and succeed.
set -eu
. "$(dirname "$0")/apt.sh"

packages="
  ament-cmake catkin g++ libgeometry-msgs-dev libgl1-mesa-dri libstd-msgs-dev make python3-diagnostic-msgs
  python3-geometry-msgs python3-map-msgs python3-nav-msgs python3-numpy python3-pil
  python3-rosbag python3-roslaunch
  python3-rosmsg python3-rosnode python3-rosparam python3-rospy python3-rosservice
  python3-rostopic python3-rviz python3-sensor-msgs python3-std-msgs python3-std-srvs
  python3-tf2-geometry-msgs python3-tf2-ros python3-visualization-msgs
  ros-geometry-msgs ros-message-generation ros-std-msgs rviz xvfb
"

skip() {
  echo "ROS 1 is not installed, so its tests are skipped: $1"
  exit 0
}

# shellcheck disable=SC2086 # a list of words
apt_lacks $packages || exit 0
grep -qsx 'VERSION_CODENAME=bookworm' /etc/os-release || skip "it comes from Debian 12"
[ "$(id -u)" = 0 ] || skip "to install it: sudo scripts/ros1.sh"
# shellcheck disable=SC2086
apt_install $packages
