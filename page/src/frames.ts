/** Poses of frames in the base frame: the only place that transforms coordinates. */

import type { Frame, Point } from "./source";

export function toBase(frame: Frame, [x, y]: Point): Point {
  const [c, s] = [Math.cos(frame.yaw), Math.sin(frame.yaw)];
  return [frame.x + c * x - s * y, frame.y + s * x + c * y];
}

export function fromBase(frame: Frame, [x, y]: Point): Point {
  const [c, s] = [Math.cos(frame.yaw), Math.sin(frame.yaw)];
  const [dx, dy] = [x - frame.x, y - frame.y];
  return [c * dx + s * dy, -s * dx + c * dy];
}
