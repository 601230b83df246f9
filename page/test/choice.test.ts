import assert from "node:assert/strict";
import { test } from "node:test";
import { coarsestZoom, finestZoom } from "../src/zooms";
import { bestName, isQuestion, matching, namesLike } from "../src/names";
import { sorted, type Column } from "../src/sorting";

const names = [
  { name: "armchair", color: "#000000", count: 9 },
  { name: "chair", color: "#000000", count: 2 },
  { name: "Chair", color: "#000000", count: 1 },
  { name: "table", color: "#000000", count: 4 },
];

test("suggestions start with what was typed, the commonest first", () => {
  assert.deepEqual(
    matching(names, "CHA").map(({ name }) => name),
    ["chair", "Chair", "armchair"],
  );
  assert.deepEqual(matching(names, "x"), []);
});

test("the name that was meant is found", () => {
  assert.equal(bestName(names, "Chair"), "Chair");
  assert.equal(bestName(names, "TABLE"), "table");
  assert.equal(bestName(names, "arm"), "armchair");
  assert.equal(bestName(names, "sink"), "sink");
});

test("a question is told from a name", () => {
  const others = ["cup in hand", "can opener"];
  const things = [...names, ...others.map((name) => ({ name, color: "#000000", count: 1 }))];
  for (const text of [
    "where is the cup",
    "chair?",
    "nearest cup",
    "the largest table",
    "cups near the sofa",
    "where's my cup",
    "I need a cup",
    "any cups left",
    "the second nearest cup",
    "tallest shelf",
    "rooms with a bed",
  ])
    assert.ok(isQuestion(things, text), text);
  for (const text of [
    "chair",
    "where",
    "coffee machine",
    "nearest",
    "cup in",
    "Cup in hand",
    "can open",
  ])
    assert.ok(!isQuestion(things, text), text);
});

test("names that are like one are told, as the server does", () => {
  const known = ["armchair", "chair", "coffee table", "table", "tablet"];
  assert.deepEqual(namesLike(known, "table"), ["table", "tablet", "coffee table"]);
  assert.deepEqual(namesLike(known, "CHAIR"), ["chair", "armchair"]);
  assert.deepEqual(namesLike(known, "cahir"), ["chair"]);
  assert.deepEqual(namesLike(known, "zebra"), []);
});

test("what is not known comes last in both directions", () => {
  const column: Column<{ n: number | null }> = { title: "n", key: ({ n }) => n };
  const rows = [{ n: 2 }, { n: null }, { n: 10 }];
  assert.deepEqual(
    sorted(rows, column, false).map(({ n }) => n),
    [2, 10, null],
  );
  assert.deepEqual(
    sorted(rows, column, true).map(({ n }) => n),
    [10, 2, null],
  );
});

test("tiles reach from exact cells to the whole map", () => {
  assert.equal(finestZoom(0.05), 0);
  assert.equal(finestZoom(0.025), -1);
  assert.equal(finestZoom(0.001), -4);
  assert.equal(coarsestZoom([0, 0, 2, 1]), 1);
  assert.equal(coarsestZoom([0, 0, 100, 41]), 6);
});
