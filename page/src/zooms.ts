/** Which tiles there are: 256 pixels wide, at zoom 0 of a centimeter each. */

import type { Extent } from "./source";

export const TILE = 256;
/** Meters, at zoom 0. */
export const PIXEL = 0.01;

/** The finest useful zoom: a cell is at least four pixels wide, a whole number of them. */
export function finestZoom(resolution: number): number {
  const zoom = Math.floor(Math.log2(resolution / 4 / PIXEL));
  return Math.min(0, Math.max(-4, zoom));
}

/** The zoom at which a whole extent is one tile. */
export function coarsestZoom([x0, y0, x1, y1]: Extent): number {
  return Math.max(1, Math.ceil(Math.log2(Math.max(x1 - x0, y1 - y0, PIXEL) / (TILE * PIXEL))));
}
