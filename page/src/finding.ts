/** Finds objects by name and place, for a page without a server: as `Hypermap.objects` does. */

import { distance, gap, holds, meet } from "./geometry";
import { namesLike } from "./names";
import type { EmbeddedShape, FindAnswer, FoundRow, Point, ObjectQuery } from "./source";

type Found = Pick<FindAnswer, "name" | "near" | "inside" | "rows" | "unknown">;

export function findObjects(shapes: Record<string, EmbeddedShape[]>, wanted: ObjectQuery): Found {
  const all = Object.entries(shapes).flatMap(([layer, own]) =>
    own.map((shape) => ({ layer, shape })),
  );
  const known = [...new Set(all.map(({ shape }) => shape.name))].sort();
  const unknown: Record<string, string[]> = {};
  const meant = (asked: string): string => {
    if (known.includes(asked)) return asked;
    unknown[asked] = namesLike(known, asked);
    return unknown[asked].length === 1 ? unknown[asked][0] : asked;
  };
  const name = wanted.name === null ? null : meant(wanted.name);
  const place = typeof wanted.near === "string" ? placeIn(wanted.near, known) : wanted.near;
  const near = place ?? meant(wanted.near as string);
  const inside = wanted.inside === null ? null : meant(wanted.inside);
  const named = (one: string) => all.map(({ shape }) => shape).filter((s) => s.name === one);
  const anchors = typeof near === "string" ? named(near) : [];
  const rooms = inside === null ? [] : named(inside);
  const away = (shape: EmbeddedShape): number =>
    place
      ? distance(shape.polygons, place)
      : Math.min(...anchors.filter((a) => a !== shape).map((a) => gap(a.polygons, shape.polygons)));
  const farthest = wanted.within ?? Number.MAX_VALUE;
  const rows: (FoundRow & { off: number })[] = [];
  for (const { layer, shape } of all) {
    if (name !== null && shape.name !== name) continue;
    if (wanted.ring && !meet(shape.polygons, [[wanted.ring]])) continue;
    const { id, centroid } = shape;
    if (inside !== null && !rooms.some((r) => r !== shape && holds(r.polygons, centroid))) continue;
    const far = away(shape);
    if (!(far <= farthest)) continue;
    const [x, y] = centroid;
    const off = place ? Math.hypot(x - place[0], y - place[1]) : 0;
    rows.push({ layer, id, name: shape.name, x, y, distance: far, off });
  }
  rows.sort((a, b) => (a.distance ?? 0) - (b.distance ?? 0) || a.off - b.off);
  return { name, near, inside, rows: rows.map(({ off: _, ...row }) => row), unknown };
}

/** The point of a text "x,y", unless an object has that name. */
function placeIn(text: string, known: string[]): Point | null {
  const numbers = text.split(",").map(Number);
  if (known.includes(text) || numbers.length !== 2 || !numbers.every(Number.isFinite)) return null;
  return [numbers[0], numbers[1]];
}
