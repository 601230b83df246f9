/** Numbers, times and files as text. */

import { closed } from "./geometry";
import type { AreaRow, Point, Polygon } from "./source";

const COUNT = new Intl.NumberFormat("en", { useGrouping: true });

export const count = (n: number): string => COUNT.format(n);

export const plural = (n: number, one: string, many = one + "s"): string =>
  `${count(n)} ${n === 1 ? one : many}`;

/** Meters, with as many digits as are significant for a pixel of this size. */
export function meters(value: number, resolution = 0.01): string {
  const digits = Math.min(4, Math.max(0, Math.ceil(-Math.log10(resolution))));
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text.replace("-", "−");
}

export const squareMeters = (area: number): string =>
  area < 0.01 ? `${(area * 1e4).toPrecision(2)} cm²` : `${trim(area.toFixed(area < 1 ? 3 : 2))} m²`;

export const trim = (text: string): string =>
  text.includes(".") ? text.replace(/0+$/, "").replace(/\.$/, "") : text;

/** A place to a tenth of a millimeter: as exact as a pointer is, and short in a command. */
export const rounded = ([x, y]: Point): Point => [Number(x.toFixed(4)), Number(y.toFixed(4))];

/** 1, 2 or 5 times a power of ten: the largest such number that is not above `most`. */
export function niceLength(most: number): number {
  const power = 10 ** Math.floor(Math.log10(most) + 1e-9);
  return [5, 2, 1].map((n) => n * power).find((n) => n <= most * (1 + 1e-9)) ?? power;
}

export function length(value: number): string {
  if (value >= 1000) return `${trim((value / 1000).toFixed(3))} km`;
  if (value >= 1) return `${trim(value.toFixed(3))} m`;
  if (value >= 0.01) return `${trim((value * 100).toFixed(2))} cm`;
  return `${trim((value * 1000).toFixed(2))} mm`;
}

/** Whether a time stamp [s] can be a date, as in times.py; some clocks begin with the recording. */
export const isDate = (seconds: number): boolean => seconds >= 3e8 && seconds <= 2.5e11;

/** A time stamp in seconds: a date in the zone of the browser if it can be one, else seconds. */
export function stamp(seconds: number | null): string {
  if (seconds === null) return "";
  if (!isDate(seconds)) return `${trim(seconds.toFixed(2))} s`;
  const behind = 60 * new Date(1000 * seconds).getTimezoneOffset();
  return new Date(1000 * (seconds - behind)).toISOString().replace("T", " ").slice(0, 19);
}

/** Seconds as a clock shows them: 1:05.3; without tenths from an hour on. */
export function clock(seconds: number): string {
  const tenths = Math.round(Math.max(0, seconds) * 10);
  const [hours, minutes] = [Math.floor(tenths / 36000), Math.floor(tenths / 600) % 60];
  const rest = (tenths % 600) / 10;
  const two = (n: number) => String(Math.floor(n)).padStart(2, "0");
  if (hours) return `${hours}:${two(minutes)}:${two(rest)}`;
  return `${minutes}:${rest.toFixed(1).padStart(4, "0")}`;
}

const COLUMNS = [
  "layer",
  "id",
  "name",
  "x",
  "y",
  "area",
  "existence",
  "first_seen",
  "last_seen",
  "tags",
] as const;

// As in spreadsheet.py: more than a sign, and not a number.
const FORMULA = /^'*[=+\-@\t\r\n\0\uff1d\uff0b\uff0d\uff20]./s;
const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;

/** Cells that a spreadsheet would evaluate as a formula are marked as text. */
function cell(value: unknown): string {
  if (value === null || value === undefined) return "";
  let text = Array.isArray(value) ? value.join(";") : String(value);
  if (FORMULA.test(text) && !NUMBER.test(text)) text = "'" + text;
  return /[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

export function csv(rows: AreaRow[]): string {
  const lines = [
    COLUMNS.join(","),
    ...rows.map((row) => COLUMNS.map((c) => cell(row[c])).join(",")),
  ];
  return lines.join("\r\n") + "\r\n";
}

export function geojson(rows: (AreaRow & { polygons: Polygon[] })[]): string {
  const features = rows.map(({ polygons, ...row }) => ({
    type: "Feature",
    id: row.id,
    properties: row,
    geometry: {
      type: "MultiPolygon",
      coordinates: polygons.map((rings) => rings.map((ring): Point[] => closed(ring))),
    },
  }));
  return JSON.stringify({ type: "FeatureCollection", features }, null, 1);
}
