/** The steps of a run, and the objects in the map at one of them; no drawing, no requests. */

import { extentOf, holds } from "../geometry";
import type { Extent, Point, Polygon } from "../source";

export type State = "mapping" | "saved" | "failed";

/** What became of the frames so far. */
export interface Counts {
  used: number;
  skipped: number;
  unusable: number;
}

/** The server's event after each change. */
export interface RunUpdate {
  /** Id of the run; another run may have the same address later. */
  run: string;
  state: State;
  message: string;
  /** Of the page that shows the map that was saved. */
  map_url: string | null;
  /** Frames of the recording, at most. */
  total: number;
  /** Frames so far. */
  done: number;
  /** In the map. */
  objects: number;
  counts: Counts;
  /** One of this many mapped frames is kept. */
  stride: number;
  /** Class name -> color. */
  colors?: Record<string, string>;
  steps: {
    /** Position of the first of these; what was known from there on is replaced. */
    first: number;
    numbers: number[];
    stamps: number[];
    places: Point[];
    objects: number[];
  };
}

export interface Detection {
  name: string;
  /** 0..1 */
  score: number;
  /** x0, y0, x1, y1 in pixels of the picture. */
  box: Extent | null;
  /** Its segment: column, row and length of each run of pixels. */
  runs: number[];
  footprint: Polygon[];
}

/** What one frame saw. */
export interface Observation {
  number: number;
  stamp: number;
  picture: { width: number; height: number; kind: "color" | "depth" };
  detections: Detection[];
  observed: Polygon[];
  /** Angles in radians; no yaw where it looks up or down. */
  camera: { x: number; y: number; yaw: number | null; width: number };
  grid: { number: number; extent: Extent } | null;
}

export interface ObjectState {
  id: number;
  name: string;
  existence: number;
  /** How many observations there were of it. */
  evidence: number;
  polygons: Polygon[];
}

export type ObjectStates = Map<number, ObjectState>;

/** The changes between the objects at two steps. */
export interface Changes {
  /** Number of the other step; null: of none. */
  since: number | null;
  set: [number, string, number, number, Polygon[]][];
  existence: [number, number][];
  removed: number[];
}

/** The objects after changes; those before stay as they are. */
export function changedBy(
  things: ObjectStates,
  { since, set, existence, removed }: Changes,
): ObjectStates {
  const after: ObjectStates = since === null ? new Map() : new Map(things);
  for (const id of removed) after.delete(id);
  for (const [id, name, value, evidence, polygons] of set) {
    after.set(id, { id, name, existence: value, evidence, polygons });
  }
  for (const [id, value] of existence) {
    const thing = after.get(id);
    if (thing) after.set(id, { ...thing, existence: value });
  }
  return after;
}

/** The classes of objects and how many there are of each, the commonest first. */
export function countsOf(things: ObjectStates): [string, number][] {
  const counts = new Map<string, number>();
  for (const { name } of things.values()) counts.set(name, (counts.get(name) ?? 0) + 1);
  return [...counts].sort(([a, m], [b, n]) => n - m || (a < b ? -1 : 1));
}

/** The object at a place; of several, the smallest, which lies on top. */
export function thingAt(things: ObjectStates, place: Point): ObjectState | null {
  const size = ({ polygons }: ObjectState) => {
    const [x0, y0, x1, y1] = extentOf(polygons);
    return (x1 - x0) * (y1 - y0);
  };
  const found = [...things.values()].filter(({ polygons }) => holds(polygons, place));
  return found.sort((a, b) => size(a) - size(b))[0] ?? null;
}

/** The steps that the server keeps, oldest first. */
export class Steps {
  numbers: number[] = [];
  stamps: number[] = [];
  places: Point[] = [];
  objects: number[] = [];

  get length(): number {
    return this.numbers.length;
  }

  take({ first, numbers, stamps, places, objects }: RunUpdate["steps"]): void {
    this.numbers = [...this.numbers.slice(0, first), ...numbers];
    this.stamps = [...this.stamps.slice(0, first), ...stamps];
    this.places = [...this.places.slice(0, first), ...places];
    this.objects = [...this.objects.slice(0, first), ...objects];
  }

  /** The position of the newest step that is not newer than a frame; 0 if all are. */
  positionOf(number: number): number {
    let [low, high] = [0, this.numbers.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.numbers[middle] <= number) low = middle + 1;
      else high = middle;
    }
    return Math.max(0, low - 1);
  }

  /** Seconds since the first step. */
  secondsAt(position: number): number {
    return (this.stamps[position] ?? 0) - (this.stamps[0] ?? 0);
  }
}

/** The longest pause when playing; longer ones in the recording are cut [s]. */
const LONGEST_PAUSE = 1;

/**
 * The position of playback.
 * @param stamps of the steps [s]
 * @param from position
 * @param time that has passed since, in the recording [s]
 * @returns the position, and the time that is left over
 */
export function advanced(
  stamps: number[],
  from: number,
  time: number,
): { position: number; left: number } {
  let [position, left] = [from, time];
  while (position + 1 < stamps.length) {
    const pause = Math.min(LONGEST_PAUSE, Math.max(0, stamps[position + 1] - stamps[position]));
    if (pause > left) return { position, left };
    left -= pause;
    position += 1;
  }
  return { position, left: 0 };
}
