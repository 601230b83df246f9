/** The same query in Python and on the command line, for a page without a server. */

import type { Point, Ring, Snippets, ObjectQuery } from "./source";

/** A word of a shell command. */
export const shellWord = (text: string): string =>
  /^[\w./,:=@%+-]+$/.test(text) ? text : `'${text.replaceAll("'", `'"'"'`)}'`;

const python = (text: string): string => JSON.stringify(text);
const pair = ([x, y]: Point): string => `[${x}, ${y}]`;
const list = (words: string[]): string => `[${words.map(python).join(", ")}]`;

export function snippetsAt(
  path: string,
  point: Point,
  frame: string | null,
  layers: string[],
): Snippets {
  return {
    python:
      `${opened(path)}for layer in ${list(layers)}:\n` +
      `    print(layer, *hypermap.labels_at(layer, ${pair(point)}${inFrame(frame)}))\n`,
    command: command(path, frame, `--at=${point.join(",")}`),
  };
}

export function snippetsInArea(path: string, ring: Ring, frame: string | null): Snippets {
  return {
    python:
      `import shapely\n${opened(path)}area = ${polygon(ring)}\n` +
      `for found in hypermap.objects(area=area${inFrame(frame)}):\n` +
      `    print(found.layer, found.object.id, found.object.name)\n`,
    command: command(path, frame, `--in=${cornersOf(ring)}`),
  };
}

export function snippetsForSearch(path: string, wanted: ObjectQuery): Snippets {
  const { name, near, within, inside, ring } = wanted;
  const given = [
    name === null ? null : python(name),
    `near=${typeof near === "string" ? python(near) : pair(near)}`,
    within === null ? null : `within=${within}`,
    inside === null ? null : `inside=${python(inside)}`,
    ring === null ? null : "area=area",
  ];
  const options = {
    name,
    near: typeof near === "string" ? near : near.join(","),
    within,
    inside,
    in: ring && cornersOf(ring),
  };
  const words = Object.entries(options).filter(([, value]) => value !== null);
  return {
    python:
      (ring ? `import shapely\n${opened(path)}area = ${polygon(ring)}\n` : opened(path)) +
      `for found in hypermap.objects(${given.filter((one) => one !== null).join(", ")}):\n` +
      `    print(found.layer, found.object.id, found.point_xy, found.distance)\n`,
    command: command(path, null, ...words.map(([key, value]) => `--${key}=${value}`)),
  };
}

export function snippetsForEvidence(path: string, layer: string, id: number): Snippets {
  return {
    python:
      `${opened(path)}seen = hypermap[${python(layer)}].evidence_of(${id})\n` +
      `for view, score, shape in zip(seen.views, seen.scores, seen.footprints):\n` +
      `    print(seen.stamps[view], score, shape)\n`,
    command: command(path, null, `--id=${id}`, `--layer=${layer}`, "--evidence"),
  };
}

const cornersOf = (ring: Ring): string => ring.map((point) => point.join(",")).join(" ");

const polygon = (ring: Ring): string =>
  `shapely.Polygon([${ring.map(([x, y]) => `(${x}, ${y})`).join(", ")}])`;

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
