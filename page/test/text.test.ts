import assert from "node:assert/strict";
import { test } from "node:test";
import {
  clock,
  csv,
  geojson,
  length,
  meters,
  niceLength,
  squareMeters,
  stamp,
} from "../src/format";
import { placeFromHash, placeToHash } from "../src/place";
import { shellWord, snippetsAt, snippetsForSearch } from "../src/snippets";
import type { AreaRow, Point, Ring } from "../src/source";
import { existenceInWords, seenInWords, timesInWords, whenInWords } from "../src/words";

const ring: Ring = [
  [0, 0],
  [1, 0],
  [0, 1],
];

const row: AreaRow = {
  layer: "semantic",
  id: 7,
  name: "chair",
  x: 1,
  y: -2.5,
  area: 0.25,
  existence: null,
  first_seen: null,
  last_seen: 12.5,
  tags: ["red", "old"],
};

test("lengths on a scale bar are 1, 2 or 5 of something", () => {
  assert.deepEqual([0.012, 0.9, 1, 4.99, 137].map(niceLength), [0.01, 0.5, 1, 2, 100]);
  assert.deepEqual([0.005, 0.2, 5, 2000].map(length), ["5 mm", "20 cm", "5 m", "2 km"]);
});

test("a place has the digits that a pixel deserves, and no negative zero", () => {
  assert.equal(meters(1.23456, 0.05), "1.23");
  assert.equal(meters(-0.0001, 0.05), "0.00");
  assert.equal(meters(-3, 1), "−3");
  assert.equal(squareMeters(0.0042), "42 cm²");
});

test("a time since the start reads like a clock", () => {
  assert.deepEqual([0, 9.94, 59.97, 65.25, 3599.9, 3600, 7325.5].map(clock), [
    "0:00.0",
    "0:09.9",
    "1:00.0",
    "1:05.3",
    "59:59.9",
    "1:00:00",
    "2:02:05",
  ]);
  assert.equal(clock(-1), "0:00.0");
});

test("a stamp is a date on the clock of whoever reads it, unless it can be none", () => {
  process.env.TZ = "Europe/Berlin";
  assert.equal(stamp(1_764_061_200), "2025-11-25 10:00:00"); // 09:00 UTC
  assert.equal(stamp(1_753_434_000), "2025-07-25 11:00:00"); // in summer
  assert.deepEqual([null, 12.5, 2e8].map(stamp), ["", "12.5 s", "200000000 s"]);
  assert.equal(stamp(1.7e18), "1700000000000000000 s"); // nanoseconds
});

test("CSV keeps commas and quotes apart, and hands no formula to a spreadsheet", () => {
  const [head, ...lines] = csv([row, { ...row, name: '=SUM(A1), "x"' }])
    .trimEnd()
    .split("\r\n");
  assert.equal(head, "layer,id,name,x,y,area,existence,first_seen,last_seen,tags");
  assert.equal(lines[0], "semantic,7,chair,1,-2.5,0.25,,,12.5,red;old");
  assert.equal(lines[1].split(",").slice(2, 4).join(","), `"'=SUM(A1), ""x"""`);
  const named = (name: string) => csv([{ ...row, name }]).slice(head.length + 2);
  assert.match(named("\n=1"), /"'\n=1"/);
  assert.match(named("\0=1"), /,'\0=1,/);
  assert.match(named("-5"), /,-5,/);
});

test("GeoJSON has closed rings", () => {
  const polygons = [
    [[[0, 0] as [number, number], [1, 0] as [number, number], [0, 1] as [number, number]]],
  ];
  const { features } = JSON.parse(geojson([{ ...row, polygons: polygons[0] ? polygons : [] }]));
  assert.deepEqual(features[0].geometry.coordinates, [
    [
      [
        [0, 0],
        [1, 0],
        [0, 1],
        [0, 0],
      ],
    ],
  ]);
  assert.equal(features[0].properties.name, "chair");
});

test("a place survives the address", () => {
  const place = { center: [1.25, -3.5], resolution: 0.01, frame: "a b", hidden: ["x&y", "z"] };
  assert.deepEqual(placeFromHash(placeToHash({ ...place, center: [1.25, -3.5] })), place);
  for (const wrong of ["", "#x=1&y=2", "#x=1&y=a&r=1", "#x=1&y=2&r=0", "#x=1&y=2&r=-1"]) {
    assert.equal(placeFromHash(wrong), null, wrong);
  }
});

test("commands and programs quote what they must", () => {
  assert.equal(shellWord("lab.hmap"), "lab.hmap");
  assert.equal(shellWord("it's"), `'it'"'"'s'`);
  assert.equal(
    snippetsAt("-a b.hmap", [1, -2], "room", ["occupancy"]).command,
    "hypermap query './-a b.hmap' --at=1,-2 --frame=room",
  );
  const wanted = { name: '"chair', near: [0, 0] as Point, within: null, inside: null, ring: null };
  assert.match(snippetsForSearch("m.hmap", wanted).python, /objects\("\\"chair", near=\[0, 0\]\)/);
  const much = { ...wanted, name: null, near: "a sink", within: 0.5, inside: "lab", ring };
  assert.match(
    snippetsForSearch("m.hmap", much).python,
    /area = shapely.Polygon\(\[\(0, 0\), \(1, 0\), \(0, 1\)\]\)\nfor found in hypermap.objects\(near="a sink", within=0.5, inside="lab", area=area\)/,
  );
  assert.equal(
    snippetsForSearch("m.hmap", much).command,
    "hypermap query m.hmap '--near=a sink' --within=0.5 --inside=lab '--in=0,0 1,0 0,1'",
  );
});

test("times are said as one says them", () => {
  const now = new Date(2026, 4, 20, 9, 30); // a Wednesday
  const at = (...when: [number, number, number, number, number]) =>
    whenInWords(new Date(...when).getTime() / 1000, now);
  assert.equal(at(2026, 4, 20, 0, 5), "today 00:05");
  assert.equal(at(2026, 4, 19, 23, 55), "yesterday 23:55");
  assert.equal(at(2026, 4, 18, 14, 2), "Monday 14:02");
  assert.equal(at(2026, 4, 14, 14, 2), "Thursday 14:02");
  assert.equal(at(2026, 4, 13, 14, 2), "13 May 14:02");
  assert.equal(at(2025, 4, 20, 9, 30), "20 May 2025, 09:30");
  assert.equal(at(2026, 4, 21, 1, 0), "21 May 01:00"); // a clock that goes ahead
  assert.equal(whenInWords(12.5, now), "at 12.5 s");
});

test("observations of several drives have dates, those of one the time since its start", () => {
  const now = new Date(2026, 10, 27, 15, 0);
  const [begin, end] = [new Date(2026, 10, 23, 9, 0), now].map((one) => one.getTime() / 1000);
  assert.equal(timesInWords(begin, end, now)(begin + 65), "Monday 09:01");
  assert.equal(timesInWords(begin, begin + 90, now)(begin + 65), "at 1:05.0");
  assert.equal(timesInWords(0, 90000, now)(65), "at 1:05.0");
});

test("what is known of an object is said in words", () => {
  const now = new Date(2026, 4, 20, 9, 30);
  const monday = new Date(2026, 4, 18, 14, 2).getTime() / 1000;
  assert.equal(seenInWords(39, monday, now), "39 times, last Monday 14:02");
  assert.equal(seenInWords(1, null, now), "once");
  assert.equal(seenInWords(null, 3, now), "last at 3 s");
  assert.equal(seenInWords(null, null, now), null);
  assert.deepEqual([5, 2.4, 0.5, -1, -4].map(existenceInWords), [
    "certainly there",
    "very likely there",
    "possibly there",
    "possibly removed",
    "very likely removed",
  ]);
});
