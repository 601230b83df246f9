/** What a layer of measured values holds: numbers with unit and deviation on a grid. */

import type { EmbeddedValues, Point, Ring } from "./source";
import { extentOf, holds } from "./geometry";

export interface Measured {
  value: number;
  /** Standard deviation; null where nobody knows it. */
  deviation: number | null;
}

const UNKNOWN = 65535;

export class MeasuredValues {
  readonly quantity: string;
  readonly unit: string;
  readonly width: number;
  readonly height: number;
  /** By rows from the grid's origin; NaN where nothing is known. */
  readonly values: Float32Array;
  private readonly deviations: Float32Array | null;

  constructor(private readonly sent: EmbeddedValues) {
    this.quantity = sent.quantity;
    this.unit = sent.unit;
    this.width = sent.grid.width;
    this.height = sent.grid.height;
    this.values = unpacked(sent.values);
    this.deviations = sent.deviations && unpacked(sent.deviations);
  }

  /** The least and the largest value; null if none is known. */
  get range(): [number, number] | null {
    const { low, step, numbers } = this.sent.values;
    let most = -1;
    for (const number of wholeNumbers(numbers))
      if (number !== UNKNOWN && number > most) most = number;
    return most < 0 ? null : [low, low + most * step];
  }

  /** What is known at a point of the base frame; null for nothing. */
  at(point: Point): Measured | null {
    const [column, row] = this.inCells(point).map(Math.floor);
    if (column < 0 || row < 0 || column >= this.width || row >= this.height) return null;
    const index = row * this.width + column;
    const value = this.values[index];
    if (Number.isNaN(value)) return null;
    const deviation = this.deviations ? this.deviations[index] : NaN;
    return { value, deviation: Number.isNaN(deviation) ? null : deviation };
  }

  /** As "21.5 ± 0.3 °C". */
  text(measured: Measured | null): string {
    if (!measured) return "Unknown";
    const { value, deviation } = measured;
    const about = deviation === null ? "" : ` ± ${this.number(deviation)}`;
    return `${this.number(value)}${about} ${this.unit}`.trimEnd();
  }

  number(value: number): string {
    const text = value.toFixed(this.sent.decimals);
    return Number(text) === 0 ? text.replace("-", "") : text;
  }

  /** The values of the cells whose centers a ring of the base frame holds. */
  valuesIn(ring: Ring): number[] {
    const found: number[] = [];
    const inCells = ring.map((point) => this.inCells(point));
    const [x0, y0, x1, y1] = extentOf([[inCells]]);
    for (let row = Math.max(0, Math.floor(y0)); row <= Math.min(this.height - 1, y1); row++) {
      for (
        let column = Math.max(0, Math.floor(x0));
        column <= Math.min(this.width - 1, x1);
        column++
      ) {
        const value = this.values[row * this.width + column];
        if (!Number.isNaN(value) && holds([[inCells]], [column + 0.5, row + 0.5]))
          found.push(value);
      }
    }
    return found;
  }

  /** A point that is given in cells from the corner of the grid, in the base frame. */
  toBase([column, row]: Point): Point {
    const { x, y, yaw, resolution } = this.sent.grid;
    const [cos, sin] = [Math.cos(yaw) * resolution, Math.sin(yaw) * resolution];
    return [x + cos * column - sin * row, y + sin * column + cos * row];
  }

  private inCells([x, y]: Point): Point {
    const { x: x0, y: y0, yaw, resolution } = this.sent.grid;
    const [cos, sin] = [Math.cos(yaw) / resolution, Math.sin(yaw) / resolution];
    return [cos * (x - x0) + sin * (y - y0), cos * (y - y0) - sin * (x - x0)];
  }
}

/** Mean and range, as text; null of no values. */
export function summaryOf(measured: MeasuredValues, values: number[]): string | null {
  if (!values.length) return null;
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  const [least, most] = values.reduce(
    ([low, high], value) => [Math.min(low, value), Math.max(high, value)],
    [Infinity, -Infinity],
  );
  const range = `${measured.number(least)} to ${measured.number(most)}`;
  return `mean ${measured.number(mean)}, ${range} ${measured.unit}`.trimEnd();
}

function unpacked({ low, step, numbers }: EmbeddedValues["values"]): Float32Array {
  return Float32Array.from(wholeNumbers(numbers), (number) =>
    number === UNKNOWN ? NaN : low + number * step,
  );
}

/** Whole numbers of two bytes, the lower one first, from Base64. */
function wholeNumbers(text: string): Uint16Array {
  const bytes = atob(text);
  const numbers = new Uint16Array(bytes.length / 2);
  for (let i = 0; i < numbers.length; i++) {
    numbers[i] = bytes.charCodeAt(2 * i) + 256 * bytes.charCodeAt(2 * i + 1);
  }
  return numbers;
}
