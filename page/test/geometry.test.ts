import assert from "node:assert/strict";
import { test } from "node:test";
import { fromBase, toBase } from "../src/frames";
import { findObjects } from "../src/finding";
import { closed, distance, extentOf, gap, holds, meet, wkt } from "../src/geometry";
import type { EmbeddedShape, Point, Polygon, Ring, ObjectQuery } from "../src/source";

const box = (x0: number, y0: number, x1: number, y1: number): Ring => [
  [x0, y0],
  [x1, y0],
  [x1, y1],
  [x0, y1],
];
const ring: Polygon = [box(0, 0, 4, 4), box(1, 1, 3, 3)];

test("a hole belongs to no polygon", () => {
  assert.equal(holds([ring], [0.5, 2]), true);
  assert.equal(holds([ring], [2, 2]), false);
  assert.equal(holds([ring], [5, 2]), false);
  assert.equal(holds([ring, [box(1.5, 1.5, 2.5, 2.5)]], [2, 2]), true);
});

test("distance is that to the outline, also from a hole, and nothing inside", () => {
  assert.equal(distance([ring], [0.5, 2]), 0);
  assert.equal(distance([ring], [2, 2]), 1);
  assert.equal(distance([ring], [7, 8]), 5);
});

test("shapes meet that cross, that touch, and that lie in each other; not in a hole", () => {
  const square = [[box(0, 0, 2, 2)]];
  assert.equal(meet(square, [[box(1, -1, 1.5, 3)]]), true);
  assert.equal(meet(square, [[box(2, 0, 3, 1)]]), true);
  assert.equal(meet(square, [[box(0.5, 0.5, 1, 1)]]), true);
  assert.equal(meet([[box(0.5, 0.5, 1, 1)]], square), true);
  assert.equal(meet(square, [[box(2.1, 0, 3, 1)]]), false);
  assert.equal(meet([ring], [[box(1.5, 1.5, 2.5, 2.5)]]), false);
});

test("rings are closed in WKT, and only once", () => {
  const triangle: Ring = [
    [0, 0],
    [1, 0],
    [0, 2],
  ];
  assert.equal(wkt([[triangle]]), "POLYGON ((0 0, 1 0, 0 2, 0 0))");
  assert.deepEqual(closed(closed(triangle)), closed(triangle));
  assert.match(wkt([ring, [triangle]]), /^MULTIPOLYGON \(\(\(0 0, .*\), \(1 1, .*\)\), \(\(0 0/);
});

test("an extent goes around all polygons", () => {
  assert.deepEqual(extentOf([ring, [box(-2, 3, -1, 9)]]), [-2, 0, 4, 9]);
});

test("a point comes back from another frame", () => {
  const frame = { frame_id: "room", x: 3, y: -1, yaw: Math.PI / 2 };
  const [x, y] = toBase(frame, [2, 0]);
  assert.ok(Math.hypot(x - 3, y - 1) < 1e-12, `${x}, ${y}`);
  const point: Point = [0.3, -7];
  const back = fromBase(frame, toBase(frame, point));
  assert.ok(Math.hypot(back[0] - point[0], back[1] - point[1]) < 1e-12);
});

test("the gap between shapes is that of their nearest points, and none where they meet", () => {
  const at = (x: number, y: number): Polygon[] => [[box(x, y, x + 1, y + 1)]];
  assert.equal(gap(at(0, 0), at(3, 0)), 2);
  assert.equal(gap(at(0, 0), at(4, 5)), 5);
  assert.equal(gap(at(0, 0), at(1, 0.5)), 0);
  assert.equal(gap([ring], at(1.5, 1.5)), 0.5); // in its hole
  assert.equal(gap([[box(0, 0, 10, 1)]], [[box(4, 3, 5, 4)]]), 2);
});

test("things are found near, within, inside and in an area, as the map itself finds them", () => {
  const thing = (id: number, name: string, x: number, y: number, side = 1): EmbeddedShape => {
    const [half, centroid] = [side / 2, [x, y] as Point];
    const polygons = [[box(x - half, y - half, x + half, y + half)]];
    return { id, name, polygons, at: centroid, centroid, area: side ** 2, attributes: {} };
  };
  const shapes = {
    things: [thing(0, "cup", 0, 0), thing(1, "cup", 4, 0), thing(2, "room", 4, 0, 4)],
    more: [thing(0, "cup", 9, 0)],
  };
  const any: ObjectQuery = { name: null, near: [0, 0], within: null, inside: null, ring: null };
  const found = (asked: Partial<ObjectQuery>) =>
    findObjects(shapes, { ...any, ...asked }).rows.map(({ layer, id }) => `${layer} ${id}`);
  assert.deepEqual(found({ name: "cup" }), ["things 0", "things 1", "more 0"]);
  assert.deepEqual(found({ name: "cup", near: "room" }), ["things 1", "things 0", "more 0"]);
  assert.deepEqual(found({ name: "cup", near: "room", within: 2 }), ["things 1", "things 0"]);
  assert.deepEqual(found({ name: "cup", near: "cup", within: 3 }), ["things 0", "things 1"]);
  assert.deepEqual(found({ inside: "room" }), ["things 1"]);
  assert.deepEqual(found({ near: "8,0", within: 1 }), ["more 0"]);
  assert.deepEqual(found({ ring: box(-1, -1, 1, 1) }), ["things 0"]);
  const { near, rows, unknown } = findObjects(shapes, { ...any, name: "cup", near: "rom" });
  assert.deepEqual([near, rows.length, unknown], ["room", 3, { rom: ["room"] }]);
});
