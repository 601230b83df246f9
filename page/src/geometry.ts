/** Plane geometry of points, rings and polygons, for a page without a server. */

import type { Extent, Point, Polygon, Ring } from "./source";

/** Whether a point lies in a ring (even-odd rule). */
function ringHolds(ring: Ring, [x, y]: Point): boolean {
  let inside = false;
  for (let i = 0, j = ring.length - 1; i < ring.length; j = i++) {
    const [ax, ay] = ring[i];
    const [bx, by] = ring[j];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) inside = !inside;
  }
  return inside;
}

export function holds(polygons: Polygon[], point: Point): boolean {
  return polygons.some((rings) =>
    rings.reduce((in_, ring) => in_ !== ringHolds(ring, point), false),
  );
}

function segmentDistance([x, y]: Point, [ax, ay]: Point, [bx, by]: Point): number {
  const [dx, dy] = [bx - ax, by - ay];
  const length2 = dx * dx + dy * dy;
  const t = length2 ? Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / length2)) : 0;
  return Math.hypot(x - ax - t * dx, y - ay - t * dy);
}

/** Distance from a point to a shape [m]; 0 inside. */
export function distance(polygons: Polygon[], point: Point): number {
  return holds(polygons, point) ? 0 : toEdge(polygons, point);
}

/** The centroid of a shape. */
export function centroidOf(polygons: Polygon[]): Point {
  let [x, y, area] = [0, 0, 0];
  const [ox, oy] = polygons[0][0][0]; // near by, so that little is lost to rounding
  for (const rings of polygons) {
    rings.forEach((ring, i) => {
      const [rx, ry, size] = ringMoments(ring.map(([px, py]): Point => [px - ox, py - oy]));
      const sign = (i === 0 ? 1 : -1) * Math.sign(size); // holes are taken off
      [x, y, area] = [x + sign * rx, y + sign * ry, area + sign * size];
    });
  }
  return [ox + x / area, oy + y / area];
}

/** The area of a ring, and its first moments; negative where it runs clockwise. */
function ringMoments(ring: Ring): [number, number, number] {
  let [x, y, area] = [0, 0, 0];
  ring.forEach(([ax, ay], i) => {
    const [bx, by] = ring[(i + 1) % ring.length];
    const cross = (ax * by - bx * ay) / 2;
    [x, y, area] = [x + (cross * (ax + bx)) / 3, y + (cross * (ay + by)) / 3, area + cross];
  });
  return [x, y, area];
}

/** Distance from a point to the nearest edge of a shape [m]. */
export function toEdge(polygons: Polygon[], point: Point): number {
  let best = Infinity;
  for (const ring of polygons.flat()) {
    for (let i = 0; i < ring.length; i++) {
      best = Math.min(best, segmentDistance(point, ring[i], ring[(i + 1) % ring.length]));
    }
  }
  return best;
}

/** Distance between two shapes [m]; 0 where they meet. */
export function gap(one: Polygon[], other: Polygon[]): number {
  if (meet(one, other)) return 0;
  // If two edges do not cross, an endpoint is nearest to the other edge.
  return Math.min(
    ...one.flat(2).map((corner) => distance(other, corner)),
    ...other.flat(2).map((corner) => distance(one, corner)),
  );
}

function side(a: Point, b: Point, c: Point): number {
  return Math.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
}

function within(a: Point, b: Point, c: Point): boolean {
  return (
    Math.min(a[0], b[0]) <= c[0] &&
    c[0] <= Math.max(a[0], b[0]) &&
    Math.min(a[1], b[1]) <= c[1] &&
    c[1] <= Math.max(a[1], b[1])
  );
}

/** Whether the segments ab and cd share a point. */
function cross(a: Point, b: Point, c: Point, d: Point): boolean {
  const [s1, s2, s3, s4] = [side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)];
  if (s1 !== s2 && s3 !== s4) return true;
  return (
    (s1 === 0 && within(a, b, c)) ||
    (s2 === 0 && within(a, b, d)) ||
    (s3 === 0 && within(c, d, a)) ||
    (s4 === 0 && within(c, d, b))
  );
}

function ringsCross(one: Ring, other: Ring): boolean {
  return one.some((a, i) => {
    const b = one[(i + 1) % one.length];
    return other.some((c, j) => cross(a, b, c, other[(j + 1) % other.length]));
  });
}

/** Whether two shapes share a point. */
export function meet(one: Polygon[], other: Polygon[]): boolean {
  if (!overlap(extentOf(one), extentOf(other))) return false;
  if (one.some((rings) => holds(other, rings[0][0]))) return true;
  if (other.some((rings) => holds(one, rings[0][0]))) return true;
  return one.flat().some((a) => other.flat().some((b) => ringsCross(a, b)));
}

export function extentOf(polygons: Polygon[]): Extent {
  const extent: Extent = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [x, y] of polygons.flat(2)) {
    extent[0] = Math.min(extent[0], x);
    extent[1] = Math.min(extent[1], y);
    extent[2] = Math.max(extent[2], x);
    extent[3] = Math.max(extent[3], y);
  }
  return extent;
}

export function overlap(one: Extent, other: Extent): boolean {
  return one[0] <= other[2] && other[0] <= one[2] && one[1] <= other[3] && other[1] <= one[3];
}

/** Rings whose last point is the first again, as GeoJSON and WKT want them. */
export function closed(ring: Ring): Ring {
  const [first, last] = [ring[0], ring[ring.length - 1]];
  return first[0] === last[0] && first[1] === last[1] ? ring : [...ring, first];
}

export function wkt(polygons: Polygon[]): string {
  const ring = (points: Ring) =>
    `(${closed(points)
      .map(([x, y]) => `${x} ${y}`)
      .join(", ")})`;
  const body = polygons.map((rings) => `(${rings.map(ring).join(", ")})`);
  return body.length === 1 ? `POLYGON ${body[0]}` : `MULTIPOLYGON (${body.join(", ")})`;
}
