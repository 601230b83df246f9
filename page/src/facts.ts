/** Facts about one object, in words and units. */

import { el } from "./dom";
import { meters, squareMeters, trim } from "./format";
import { fromBase } from "./frames";
import { ROOMS } from "./looks";
import type { Frame, ObjectDetails } from "./source";
import { existenceInWords, seenInWords, whenInWords } from "./words";

type Fact = [title: string, said: string, more?: string];

/** Attributes that are shown elsewhere. */
const SHOWN_ELSEWHERE = [
  "evidence",
  "z_min",
  "z_max",
  "existence",
  "first_seen",
  "last_seen",
  "confidence",
];
const OF_ROOMS_SHOWN_ELSEWHERE = ["doors", "automatic_name"];

export function objectFacts(object: ObjectDetails, frame: Frame, now = new Date()): HTMLElement {
  const { area, at, room, tags, attributes } = object;
  const [x, y] = fromBase(frame, at).map((value) => meters(value));
  // A single-file page has them all as attributes.
  const number = (key: keyof ObjectDetails) => numberOf(object[key] ?? attributes[key]);
  const [existence, first, last] = [number("existence"), number("first_seen"), number("last_seen")];
  const seen = seenInWords(numberOf(attributes["evidence"]), last, now);
  const [low, high] = [numberOf(attributes["z_min"]), numberOf(attributes["z_max"])];
  const hidden = [...SHOWN_ELSEWHERE, ...(object.layer === ROOMS ? OF_ROOMS_SHOWN_ELSEWHERE : [])];
  const doors = (object.doors ?? []).map(({ to, width }) => `${meters(width)} m to ${to}`);
  const facts: (Fact | null)[] = [
    existence === null
      ? null
      : ["Certainty", existenceInWords(existence), `log-odds ${trim(existence.toFixed(2))}`],
    seen === null ? null : ["Seen", seen],
    first === null || first === last ? null : ["First seen", whenInWords(first, now)],
    room === undefined ? null : ["Room", room],
    ["Area", squareMeters(area)],
    ["Middle", `x ${x}, y ${y} m in ${frame.frame_id}`],
    low === null || high === null ? null : ["Height", `${meters(low)} to ${meters(high)} m`],
    tags.length
      ? ["Tags", tags.map((tag, i) => tagInWords(tag, sureness(object)[i])).join(", ")]
      : null,
    doors.length ? [doors.length > 1 ? "Doors" : "Door", doors.join(", ")] : null,
    ...Object.entries(attributes)
      .filter(([key, value]) => !hidden.includes(key) && value !== null && value !== "")
      .map(([key, value]): Fact => [heading(key), said(value)]),
  ];
  return el(
    "dl",
    { class: "facts" },
    ...facts
      .filter((fact) => fact !== null)
      .flatMap(([title, text, more]) => [
        el("dt", { text: title }),
        el("dd", {}, text, more ? el("span", { class: "quiet", text: ` (${more})` }) : null),
      ]),
  );
}

/** The pictures of an object, the best first; null if there are none. */
export function objectPictures({ name, pictures = [] }: ObjectDetails): HTMLElement | null {
  if (pictures.length === 0) return null;
  return el(
    "div",
    { class: "pictures" },
    ...pictures.map((src, i) => el("img", { src, alt: `${name}, picture ${i + 1}` })),
  );
}

function sureness({ confidence, attributes }: ObjectDetails): number[] {
  const given = confidence ?? attributes["confidence"];
  return Array.isArray(given) ? given.map(Number) : [];
}

function tagInWords(tag: string, confidence: number | undefined): string {
  return confidence === undefined ? tag : `${tag} (${Math.round(100 * confidence)} %)`;
}

const numberOf = (value: unknown): number | null => (typeof value === "number" ? value : null);

function heading(key: string): string {
  const text = key.replaceAll("_", " ");
  return text.charAt(0).toUpperCase() + text.slice(1);
}

function said(value: unknown): string {
  if (typeof value === "number") return trim(value.toFixed(4));
  if (typeof value === "string") return value;
  if (!Array.isArray(value) || value.length === 0) return JSON.stringify(value);
  return value.map(said).join(", ");
}
