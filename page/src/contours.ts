/** Lines of equal value on a grid, by marching squares (Lorensen and Cline 1987, in the plane). */

import type { Point } from "./source";

export interface Contour {
  level: number;
  /** From the grid's corner, in cells. */
  points: Point[];
}

const MOST_LEVELS = 8;

/** Round levels between two values. */
export function levelsBetween(low: number, high: number): number[] {
  if (!(high > low)) return [];
  const least = (high - low) / MOST_LEVELS;
  const power = 10 ** Math.floor(Math.log10(least));
  const step = power * ([1, 2, 5].find((factor) => factor * power >= least) ?? 10);
  const levels = [];
  for (let i = Math.floor(low / step) + 1; i * step < high; i++) {
    levels.push(Number((i * step).toPrecision(12)));
  }
  return levels;
}

/** A grid of at most so many cells, for which every second or third along a side is taken. */
export function thinned(
  values: Float32Array,
  width: number,
  height: number,
  most: number,
): { values: Float32Array; width: number; height: number; every: number } {
  const every = Math.ceil(Math.sqrt(values.length / most));
  if (every < 2) return { values, width, height, every: 1 };
  const [columns, rows] = [Math.ceil(width / every), Math.ceil(height / every)];
  const left = new Float32Array(columns * rows);
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      left[row * columns + column] = values[(row * width + column) * every];
    }
  }
  return { values: left, width: columns, height: rows, every };
}

/** The lines at a level between the centers of cells; none beside cells that are NaN. */
export function contoursAt(
  values: Float32Array,
  width: number,
  height: number,
  level: number,
): Contour[] {
  // The two pieces of line that end at each crossed side; a side has the number of its first
  // corner, twice, plus one if it goes upwards.
  const ends = new Map<number, number[]>();
  const join = (a: number, b: number) => {
    ends.set(a, [...(ends.get(a) ?? []), b]);
    ends.set(b, [...(ends.get(b) ?? []), a]);
  };
  for (let row = 0; row + 1 < height; row++) {
    for (let column = 0; column + 1 < width; column++) {
      const corner = row * width + column;
      const isAbove = values[corner] > level;
      if (
        isAbove === values[corner + 1] > level &&
        isAbove === values[corner + width] > level &&
        isAbove === values[corner + width + 1] > level
      )
        continue; // as nearly everywhere
      const four = [corner, corner + 1, corner + width + 1, corner + width];
      const above = four.map((index) => values[index] > level);
      if (four.some((index) => Number.isNaN(values[index]))) continue;
      // Sides in the order of the corners: below, right, above, left.
      const sides = [2 * corner, 2 * (corner + 1) + 1, 2 * (corner + width), 2 * corner + 1];
      const crossed = sides.filter((_, i) => above[i] !== above[(i + 1) % 4]);
      if (crossed.length === 2) join(crossed[0], crossed[1]);
      if (crossed.length < 4) continue;
      const mean = four.reduce((sum, index) => sum + values[index], 0) / 4;
      const first = mean > level === above[0] ? [0, 1, 2, 3] : [3, 0, 1, 2];
      join(sides[first[0]], sides[first[1]]);
      join(sides[first[2]], sides[first[3]]);
    }
  }
  const place = (side: number): Point => {
    const corner = side >> 1;
    const isUp = side % 2 === 1;
    const next = values[corner + (isUp ? width : 1)];
    const share = (level - values[corner]) / (next - values[corner]);
    const [column, row] = [(corner % width) + 0.5, Math.floor(corner / width) + 0.5];
    return isUp ? [column, row + share] : [column + share, row];
  };
  return chains(ends).map((chain) => ({ level, points: chain.map(place) }));
}

/** Lines through neighbors: first those with two ends, then the closed ones. */
function chains(neighbors: Map<number, number[]>): number[][] {
  const left = new Set(neighbors.keys());
  const found: number[][] = [];
  const follow = (start: number) => {
    const chain = [start];
    left.delete(start);
    for (let next: number | undefined = start; next !== undefined;) {
      next = neighbors.get(next)?.find((side) => left.has(side));
      if (next === undefined) break;
      left.delete(next);
      chain.push(next);
    }
    if (chain.length > 2 && neighbors.get(start)?.includes(chain[chain.length - 1])) {
      chain.push(start);
    }
    found.push(chain);
  };
  for (const [side, others] of neighbors) if (others.length === 1 && left.has(side)) follow(side);
  for (const side of neighbors.keys()) if (left.has(side)) follow(side);
  return found;
}
