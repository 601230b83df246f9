import assert from "node:assert/strict";
import { test } from "node:test";
import { contoursAt, levelsBetween, thinned } from "../src/contours";
import type { EmbeddedValues } from "../src/source";
import { MeasuredValues, summaryOf } from "../src/values";

const packed = (low: number, step: number, ...numbers: number[]) => ({
  low,
  step,
  numbers: Buffer.from(new Uint16Array(numbers).buffer).toString("base64"),
});

const sent: EmbeddedValues = {
  quantity: "temperature",
  unit: "°C",
  decimals: 1,
  grid: { x: 10, y: 20, yaw: Math.PI / 2, resolution: 0.5, width: 3, height: 1 },
  values: packed(18, 0.5, 0, 3, 65535),
  deviations: packed(0.25, 0.5, 0, 1, 65535),
};

test("a value is read at its place in a turned grid, with its deviation", () => {
  const values = new MeasuredValues(sent);
  assert.equal(values.text(values.at([9.75, 20.25])), "18.0 ± 0.3 °C");
  assert.equal(values.text(values.at([9.75, 20.75])), "19.5 ± 0.8 °C");
  assert.equal(values.text(values.at([9.75, 21.25])), "Unknown");
  assert.equal(values.at([10.25, 20.25]), null);
  assert.deepEqual(values.range, [18, 19.5]);
});

test("an area has the mean and range of the cells in it, unknown ones aside", () => {
  const values = new MeasuredValues(sent);
  const all = values.valuesIn([
    [9, 19],
    [11, 19],
    [11, 23],
    [9, 23],
  ]);
  assert.equal(summaryOf(values, all), "mean 18.8, 18.0 to 19.5 °C");
  assert.equal(summaryOf(values, []), null);
});

test("levels are round and lie between the least and the largest value", () => {
  assert.deepEqual(levelsBetween(18.2, 24.9), [19, 20, 21, 22, 23, 24]);
  assert.deepEqual(levelsBetween(-0.05, 0.06), [-0.04, -0.02, 0, 0.02, 0.04]);
  assert.deepEqual(levelsBetween(3, 3), []);
});

test("a slope has one straight line, where its value is", () => {
  const slope = Float32Array.from([0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3]);
  const [line, ...others] = contoursAt(slope, 4, 3, 1.25);
  assert.deepEqual(others, []);
  assert.deepEqual(
    line.points.sort((a, b) => a[1] - b[1]),
    [
      [1.75, 0.5],
      [1.75, 1.5],
      [1.75, 2.5],
    ],
  );
});

test("a hill has a closed line, and unknown cells have none beside them", () => {
  const hill = Float32Array.from([0, 0, 0, 0, 4, 0, 0, 0, 0]);
  const [line] = contoursAt(hill, 3, 3, 1);
  assert.equal(line.points.length, 5);
  assert.deepEqual(line.points[0], line.points[4]);
  hill[0] = NaN;
  assert.equal(contoursAt(hill, 3, 3, 1)[0].points.length, 4);
});

test("of a fine grid every second cell is taken, so that lines of a million cells are quick", () => {
  const fine = Float32Array.from({ length: 15 }, (_, index) => index);
  const { values, width, height, every } = thinned(fine, 5, 3, 6);
  assert.deepEqual([[...values], width, height, every], [[0, 2, 4, 10, 12, 14], 3, 2, 2]);
  assert.equal(thinned(fine, 5, 3, 15).values, fine);
  const slope = Float32Array.from({ length: 1_000_000 }, (_, index) => index % 1000);
  const began = performance.now();
  for (let level = 100; level < 900; level += 100) contoursAt(slope, 1000, 1000, level + 0.5);
  assert.ok(performance.now() - began < 5000);
});
