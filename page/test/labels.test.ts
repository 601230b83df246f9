import assert from "node:assert/strict";
import { test } from "node:test";
import { placeLabels, type Box, type Named } from "../src/labels";

const thing = (box: Box, width = 40): Named => {
  const [x0, y0, x1, y1] = box;
  return { box, at: [(x0 + x1) / 2, (y0 + y1) / 2], size: [width, 16] };
};

test("a name stands on what is large enough for it, and beside what is not", () => {
  const [table, cup] = [thing([0, 0, 100, 60]), thing([200, 0, 220, 20])];
  assert.deepEqual(placeLabels([table, cup]), ["on", "right"]);
});

test("a name lies on no other thing, but on what bears its own", () => {
  const table = thing([0, 0, 200, 100]);
  const cup = thing([20, 70, 30, 80], 24);
  assert.deepEqual(placeLabels([cup, table]), ["right", "on"]);
  const plate = thing([90, 40, 110, 60], 24); // in its middle
  assert.deepEqual(placeLabels([plate, table]), ["right", "low"]);
  const [lamp, chair] = [thing([0, 0, 20, 20]), thing([24, 0, 80, 40])];
  assert.deepEqual(placeLabels([lamp, chair]), ["below", "on"]);
});

test("a name stands in a room that the box around a corridor with a corner reaches into", () => {
  const room = thing([0, 0, 300, 200]);
  const corner: Named = {
    ...thing([20, 20, 250, 150]),
    // Along the left and the lower side of its box.
    shape: {
      meets: ([x0, y0, x1]) => x0 < 30 || (y0 < 30 && x1 > 20),
      holds: ([x, y]) => x < 30 || y < 30,
    },
  };
  assert.equal(placeLabels([room, corner])[0], "on");
  const box = { ...corner, shape: undefined };
  assert.notEqual(placeLabels([room, box])[0], "on");
  const cupboard = thing([50, 60, 70, 80]); // in the room, and not in the corridor
  assert.deepEqual(placeLabels([corner, cupboard])[1], "right");
});

test("a name stands within the map rather than outside", () => {
  const lamp = thing([80, 40, 100, 60]);
  assert.deepEqual(placeLabels([lamp]), ["right"]);
  assert.deepEqual(placeLabels([lamp], [0, 0, 100, 100]), ["left"]);
  assert.deepEqual(placeLabels([lamp], [70, 40, 100, 60]), ["right"]); // no room in there
});

test("names do not lie on each other; one without room is left out", () => {
  const row = [0, 1, 2, 3].map((i) => thing([i * 12, 0, i * 12 + 10, 10], 60));
  const sides = placeLabels(row);
  assert.deepEqual([sides[0], sides[3]], ["above", "right"]);
  assert.ok(sides.includes(null));
});
