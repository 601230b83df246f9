/** How a program or the command line asks the same, where no server says it. */

import type { Point, Ring, Spelled } from "./source";

/** A word of a shell command. */
export const shellWord = (text: string): string =>
  /^[\w./,:=@%+-]+$/.test(text) ? text : `'${text.replaceAll("'", `'"'"'`)}'`;

const python = (text: string): string => JSON.stringify(text);
const pair = ([x, y]: Point): string => `[${x}, ${y}]`;
const list = (words: string[]): string => `[${words.map(python).join(", ")}]`;

export function spellAt(
  path: string,
  point: Point,
  frame: string | null,
  layers: string[],
): Spelled {
  return {
    python:
      `${opened(path)}for layer in ${list(layers)}:\n` +
      `    print(layer, *hypermap.labels_at(layer, ${pair(point)}${inFrame(frame)}))\n`,
    command: command(path, frame, `--at=${point.join(",")}`),
  };
}

export function spellArea(path: string, ring: Ring, frame: string | null): Spelled {
  const corners = ring.map(([x, y]) => `(${x}, ${y})`).join(", ");
  return {
    python:
      `import shapely\n${opened(path)}area = shapely.Polygon([${corners}])\n` +
      `for found in hypermap.objects(area=area${inFrame(frame)}):\n` +
      `    print(found.layer, found.object.id, found.object.name)\n`,
    command: command(path, frame, `--in=${ring.map((point) => point.join(",")).join(" ")}`),
  };
}

export function spellFind(path: string, name: string, near: Point): Spelled {
  return {
    python:
      `${opened(path)}for found in hypermap.objects(${python(name)}, near=${pair(near)}):\n` +
      `    print(found.layer, found.object.id, found.point_xy, found.distance)\n`,
    command: command(path, null, `--name=${name}`, `--near=${near.join(",")}`),
  };
}

export function spellEvidence(path: string, layer: string, id: number): Spelled {
  return {
    python:
      `${opened(path)}seen = hypermap[${python(layer)}].evidence_of(${id})\n` +
      `for view, score, shape in zip(seen.views, seen.scores, seen.footprints):\n` +
      `    print(seen.stamps[view], score, shape)\n`,
    command: command(path, null, `--id=${id}`, `--layer=${layer}`, "--evidence"),
  };
}

const opened = (path: string): string =>
  `from hypermap import open_map\n\nhypermap = open_map(${python(path)})\n`;

const inFrame = (frame: string | null): string =>
  frame === null ? "" : `, frame_id=${python(frame)}`;

function command(path: string, frame: string | null, ...options: string[]): string {
  const file = path.startsWith("-") ? `./${path}` : path;
  const words = ["hypermap", "query", file, ...options];
  if (frame !== null) words.push(`--frame=${frame}`);
  return words.map(shellWord).join(" ");
}
