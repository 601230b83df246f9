import assert from "node:assert/strict";
import { test } from "node:test";
import {
  advanced,
  changedBy,
  countsOf,
  Steps,
  thingAt,
  type Changes,
  type ObjectStates,
} from "../src/run/steps";
import type { Point, Polygon } from "../src/source";

const SQUARE: Polygon[] = [
  [
    [
      [0, 0],
      [1, 0],
      [1, 1],
    ],
  ],
];

function changes(given: Partial<Changes>): Changes {
  return { since: 1, set: [], existence: [], removed: [], ...given };
}

test("changes make the objects of one step of those of another, which stay as they were", () => {
  const none: ObjectStates = new Map();
  const first = changedBy(
    none,
    changes({
      since: null,
      set: [
        [1, "cup", 0.5, 1, SQUARE],
        [2, "chair", 2, 3, SQUARE],
      ],
    }),
  );
  const second = changedBy(
    first,
    changes({ set: [[3, "cup", 1, 1, SQUARE]], existence: [[2, 1.8]], removed: [1] }),
  );
  assert.equal(none.size, 0);
  assert.deepEqual([...first.keys()], [1, 2]);
  assert.deepEqual([...second.keys()], [2, 3]);
  assert.deepEqual([first.get(2)?.existence, second.get(2)?.existence], [2, 1.8]);
  assert.deepEqual(second.get(2)?.polygons, SQUARE);
  // A step that comes whole, since the one before is no longer known, forgets what was shown.
  assert.deepEqual([...changedBy(second, changes({ since: null })).keys()], []);
});

test("classes are counted, the commonest first", () => {
  const names = ["cup", "chair", "cup", "bed"];
  const set = names.map((name, id): Changes["set"][number] => [id, name, 1, 1, SQUARE]);
  assert.deepEqual(countsOf(changedBy(new Map(), changes({ since: null, set }))), [
    ["cup", 2],
    ["bed", 1],
    ["chair", 1],
  ]);
});

test("the smallest object at a place is the one that is meant", () => {
  const side = (a: number): Polygon[] => [[[[0, 0], [a, 0], [a, a], [0, a]]]]; // prettier-ignore
  const set: Changes["set"] = [
    [1, "table", 1, 1, side(4)],
    [2, "cup", 1, 1, side(1)],
    [3, "rug", 1, 1, side(9)],
  ];
  const things = changedBy(new Map(), changes({ since: null, set }));
  const at = (x: number, y: number) => thingAt(things, [x, y])?.name ?? null;
  assert.deepEqual([at(0.5, 0.5), at(2, 2), at(8, 8), at(10, 1)], ["cup", "table", "rug", null]);
});

function news(first: number, numbers: number[]) {
  const places = numbers.map((n): Point => [n, 0]);
  return { first, numbers, stamps: numbers.map((n) => 100 + n / 10), places, objects: numbers };
}

test("steps come one after the other, and are fewer after every second was dropped", () => {
  const steps = new Steps();
  assert.deepEqual([steps.length, steps.positionOf(5), steps.secondsAt(0)], [0, 0, 0]);
  steps.take(news(0, [1, 3, 4]));
  steps.take(news(3, [7, 9]));
  assert.deepEqual(steps.numbers, [1, 3, 4, 7, 9]);
  assert.deepEqual(
    [0, 1, 2, 4, 8, 99].map((number) => steps.positionOf(number)),
    [0, 0, 0, 2, 3, 4],
  );
  assert.ok(Math.abs(steps.secondsAt(4) - 0.8) < 1e-9);
  steps.take(news(0, [3, 7]));
  assert.deepEqual([steps.numbers, steps.positionOf(4)], [[3, 7], 0]);
});

test("playing goes as the recording went, but waits for no long pause", () => {
  const stamps = [0, 0.1, 0.2, 60, 60.1];
  assert.deepEqual(advanced(stamps, 0, 0.05), { position: 0, left: 0.05 });
  assert.equal(advanced(stamps, 0, 0.15).position, 1);
  assert.equal(advanced(stamps, 0, 0.95).position, 2);
  assert.equal(advanced(stamps, 2, 1.01).position, 3);
  assert.deepEqual(advanced(stamps, 0, 99), { position: 4, left: 0 });
  // Stamps that go back, or are all the same, hold nothing up.
  assert.deepEqual(advanced([5, 4, 4], 0, 0), { position: 2, left: 0 });
  assert.deepEqual(advanced([], 0, 1), { position: 0, left: 0 });
});
