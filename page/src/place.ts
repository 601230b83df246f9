/** The view in the address, so that a link shows the same place. */

import type { Point } from "./source";

export interface Place {
  center: Point;
  /** Meters per pixel. */
  resolution: number;
  frame: string | null;
  /** Names of the layers that are switched off. */
  hidden: string[];
}

export function placeToHash({ center, resolution, frame, hidden }: Place): string {
  const digits = Math.max(2, Math.ceil(-Math.log10(resolution)) + 1);
  const values = new URLSearchParams({
    x: center[0].toFixed(digits),
    y: center[1].toFixed(digits),
    r: resolution.toPrecision(4),
  });
  if (frame !== null) values.set("frame", frame);
  for (const name of hidden) values.append("off", name);
  return `#${values}`;
}

/** The place in an address, or null where it names none. */
export function placeFromHash(hash: string): Place | null {
  const values = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (key: string) => (values.has(key) ? Number(values.get(key)) : NaN);
  const [x, y, resolution] = [number("x"), number("y"), number("r")];
  if (!Number.isFinite(x) || !Number.isFinite(y) || !(resolution > 0 && resolution < 1e6))
    return null;
  return { center: [x, y], resolution, frame: values.get("frame"), hidden: values.getAll("off") };
}
