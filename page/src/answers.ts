/** Answers as elements: for a place, an area, a name, and one object. */

import { complain, el, icon, saveFile } from "./dom";
import { count, meters, plural, squareMeters, stamp, trim } from "./format";
import { swatch } from "./layers";
import {
  Refused,
  type AreaAnswer,
  type AreaRow,
  type ChangeEnd,
  type Coverage,
  type Download,
  type FindAnswer,
  type FoundRow,
  type MapInfo,
  type ObjectAt,
  type ObjectChange,
  type PathAnswer,
  type PointAnswer,
  type ObjectQuery,
  type VersionChanges,
  type WordsAnswer,
} from "./source";
import type { Column } from "./sorting";
import { table } from "./table";

/** Chooses an object: it is shown on the map and in the panel. */
export type Choose = (layer: string, id: number) => void;

function labelled(info: MapInfo, layer: string, label: string): HTMLElement {
  const found = info.layers.find(({ name }) => name === layer);
  const kind = found?.kind === "raster" ? "raster" : "shapes";
  const color =
    found?.classes.find(({ name }) => name === label)?.color ??
    found?.legend.find((entry) => entry.label === label)?.color;
  return el(
    "span",
    { class: "labelled" },
    color ? swatch(color, kind) : null,
    el("span", { class: "name", text: label }),
  );
}

/** @param facts - of the only object there, if there is just one: shown at once. */
export function pointContent(
  answer: PointAnswer,
  info: MapInfo,
  choose: Choose,
  facts: Node[] | null,
): HTMLElement[] {
  const row = (layer: string, { id, name, area }: ObjectAt) =>
    el(
      "li",
      {},
      el(
        "button",
        { type: "button", class: "object", onclick: () => choose(layer, id) },
        labelled(info, layer, name),
        el("span", {
          class: "quiet",
          text: [`id ${id}`, area === undefined ? "" : squareMeters(area)]
            .filter(Boolean)
            .join(" · "),
        }),
        icon("chevron"),
      ),
    );
  return answer.layers.map(({ name, label, value, objects }) => {
    const raster = info.layers.find((layer) => layer.name === name)?.kind !== "shapes";
    return el(
      "section",
      { class: "at", data: { layer: name } },
      el("h3", { text: name }),
      raster
        ? el(
            "p",
            { class: "said" },
            labelled(info, name, label || "Nothing"),
            value === null ? null : el("span", { class: "quiet value", text: String(value) }),
          )
        : objects.length === 0
          ? el("p", { class: "quiet", text: "No object here" })
          : null,
      ...(facts && objects.length
        ? [el("p", { class: "said" }, labelled(info, name, objects[0].name)), ...facts]
        : []),
      objects.length && !facts
        ? el("ul", { class: "objects" }, ...objects.map((object) => row(name, object)))
        : null,
    );
  });
}

/** @param change - takes another radius of the robot [m]. */
export function pathContent(
  answer: PathAnswer | Refused,
  radius: number,
  change: (radius: number) => void,
): (HTMLElement | null)[] {
  const input = el("input", { type: "number", id: "robot-radius", value: String(radius) });
  Object.assign(input, { min: "0", step: "0.05" });
  input.onchange = () => {
    if (input.checkValidity() && input.value) change(Number(input.value));
  };
  const field = el(
    "p",
    { class: "said" },
    el("label", { for: "robot-radius", text: "Radius of the robot [m]" }),
    input,
  );
  if (answer instanceof Refused) {
    const { message } = answer;
    return [el("p", { text: `${message[0]?.toUpperCase() ?? ""}${message.slice(1)}.` }), field];
  }
  const { rooms, doors } = answer;
  const list = (title: string, lines: string[]) =>
    lines.length === 0
      ? null
      : el(
          "section",
          { class: "at" },
          el("h3", { text: title }),
          el("ol", { class: "passed" }, ...lines.map((text) => el("li", { text }))),
        );
  return [
    field,
    list(
      "Rooms",
      rooms.map(({ name }) => name),
    ),
    list(
      "Doors",
      doors.map(
        ({ place: [x, y], width }) => `${meters(x)}, ${meters(y)}: ${meters(width)} m wide`,
      ),
    ),
  ];
}

export function coverageContent(coverage: Coverage): HTMLElement[] {
  const { share, size, rest_size } = coverage;
  const bar = el("progress", { id: "covered", aria: { label: "Covered" } });
  Object.assign(bar, { max: 1, value: share });
  return [
    bar,
    el("p", {
      text: `The area to map is ${squareMeters(size)}; ${squareMeters(rest_size)} are not covered yet and marked on the map. The layer mapped_grid shows what is covered.`,
    }),
  ];
}

export function areaSummary({ rows, total }: AreaAnswer): string {
  const all = total ?? rows.length;
  const first = all > rows.length ? `, the first ${count(rows.length)} shown` : "";
  return all === 0 ? "No object in this area" : plural(all, "object") + first;
}

export function areaContent(
  answer: AreaAnswer,
  info: MapInfo,
  choose: Choose,
  download: (kind: Download) => Promise<Blob>,
): (HTMLElement | null)[] {
  const { rows, cells } = answer;
  const has = (key: "existence" | "first_seen" | "last_seen") =>
    rows.some((row) => row[key] !== null);
  const columns: (Column<AreaRow> | false)[] = [
    { title: "Name", key: (row) => row.name, text: (row) => labelled(info, row.layer, row.name) },
    { title: "Id", key: (row) => row.id, numeric: true },
    new Set(rows.map((row) => row.layer)).size > 1 && { title: "Layer", key: (row) => row.layer },
    { title: "Area", key: (row) => row.area, text: (row) => squareMeters(row.area), numeric: true },
    { title: "x", key: (row) => row.x, text: (row) => meters(row.x), numeric: true },
    { title: "y", key: (row) => row.y, text: (row) => meters(row.y), numeric: true },
    has("existence") && {
      title: "Existence",
      key: (row) => row.existence,
      text: (row) => (row.existence === null ? "" : trim(row.existence.toFixed(2))),
      numeric: true,
    },
    has("first_seen") && {
      title: "First seen",
      key: (row) => row.first_seen,
      text: (row) => stamp(row.first_seen),
      numeric: true,
    },
    has("last_seen") && {
      title: "Last seen",
      key: (row) => row.last_seen,
      text: (row) => stamp(row.last_seen),
      numeric: true,
    },
    rows.some((row) => row.tags.length) && {
      title: "Tags",
      key: (row) => row.tags.join(", ") || null,
    },
  ];
  return [
    rows.length
      ? table(
          "What is in the area",
          columns.filter((column) => column !== false),
          rows,
          (row) => choose(row.layer, row.id),
        )
      : null,
    rows.length ? downloads(info, download) : null,
    cells.length ? cellCounts(answer, info) : null,
  ];
}

function downloads(info: MapInfo, download: (kind: Download) => Promise<Blob>): HTMLElement {
  const button = (kind: Download, label: string) =>
    el("button", {
      type: "button",
      class: "button small",
      id: `download-${kind}`,
      text: label,
      onclick: () =>
        void download(kind)
          .then((content) => saveFile(`${info.name}-area.${kind}`, content))
          .catch(complain),
    });
  return el(
    "div",
    { class: "buttons" },
    el("span", { class: "quiet grow", text: "Download" }),
    button("csv", "CSV"),
    button("geojson", "GeoJSON"),
  );
}

function cellCounts({ cells }: AreaAnswer, info: MapInfo): HTMLElement {
  const sizes = new Map(info.layers.map(({ name, resolution }) => [name, resolution ?? 0]));
  return el(
    "section",
    {},
    el("h3", { text: "Cells" }),
    el(
      "ul",
      { class: "cells" },
      ...cells.map(({ layer, label, count: n, about }) => {
        const area = n * (sizes.get(layer) ?? 0) ** 2;
        return el(
          "li",
          { title: layer },
          labelled(info, layer, label || "Nothing"),
          el("span", {
            class: "quiet",
            text: `${about ? "about " : ""}${count(n)} · ${squareMeters(area)}`,
          }),
        );
      }),
    ),
  );
}

const distanceText = (distance: number | null): string =>
  distance === null ? "" : `${meters(distance)} m`;

/** @param facts - of the only match, if there is just one: shown at once. */
export function findContent(
  answer: Pick<FindAnswer, "rows">,
  info: MapInfo,
  choose: (row: FoundRow) => void,
  look: (rank: number | null) => void,
  facts: Node[],
): Node[] {
  const several = new Set(answer.rows.map((row) => row.layer)).size > 1;
  const row = (found: FoundRow, rank: number) =>
    el(
      "li",
      {},
      el(
        "button",
        {
          type: "button",
          class: "object",
          data: { id: String(found.id), layer: found.layer },
          onclick: () => choose(found),
          onfocus: () => look(rank),
          onblur: () => look(null),
        },
        el("span", { class: "rank", text: String(rank + 1) }),
        labelled(info, found.layer, found.name),
        el("span", {
          class: "quiet",
          text: [several ? found.layer : "", found.room, distanceText(found.distance)]
            .filter(Boolean)
            .join(" · "),
        }),
        icon("chevron"),
      ),
    );
  const list = el("ol", { class: "objects found" }, ...answer.rows.map(row));
  list.addEventListener("keydown", stepByArrows);
  return [list, ...facts];
}

/** What changed in a version of the map. */
export function changesContent(
  { changes, total, doubtful }: VersionChanges,
  colors: Record<string, string>,
  look: (end: ChangeEnd) => void,
): Node[] {
  const row = ({ kind, layer, id, distance, confidence, before, after }: ObjectChange) => {
    const end = after ?? before;
    if (!end) return null;
    const isRenamed = before && after && before.name !== after.name;
    const name = isRenamed ? `${before.name} → ${after.name}` : end.name;
    const isElsewhere = kind === "moved" || kind === "corrected"; // by poses
    const far = isElsewhere && distance !== null ? `by ${meters(distance)} m` : "";
    const sure = confidence === null ? "" : `${Math.round(100 * confidence)} % sure`;
    return el(
      "li",
      {},
      el(
        "button",
        {
          type: "button",
          class: "object",
          data: { id: String(id), layer },
          onclick: () => look(end),
        },
        swatch(colors[kind] ?? "#808080"),
        el("span", { class: "name", text: name }),
        el("span", { class: "quiet", text: [kind, far, sure].filter(Boolean).join(" · ") }),
      ),
    );
  };
  const list = el("ol", { class: "objects found changed" }, ...changes.map(row));
  list.addEventListener("keydown", stepByArrows);
  const facts = [
    total > changes.length ? `The first ${count(changes.length)} of ${count(total)} changes` : "",
    doubtful ? `Left out, as doubtful: ${count(doubtful)}` : "",
  ];
  return [list, ...facts.filter(Boolean).map((text) => el("p", { class: "quiet", text }))];
}

/** How a question was understood, and its answer in words. */
export function wordsContent({ understood, words }: WordsAnswer): Node[] {
  const parts = understood.flatMap(([part, meaning]) => [
    el("dt", { text: part }),
    el("dd", { text: meaning }),
  ]);
  return [
    ...words.map((line) => el("p", { class: "answer", text: line })),
    el(
      "details",
      {},
      el("summary", { text: "How this was understood" }),
      el("dl", { class: "facts" }, ...parts),
    ),
  ];
}

/** Why a question in English has no answer, and what can be asked instead. */
export function unreadContent(error: Refused): Node[] {
  return error.message.split("\n").map((line) => el("p", { text: line }));
}

/** Arrow keys move through the matches. */
function stepByArrows(event: KeyboardEvent): void {
  const list = event.currentTarget as HTMLElement;
  const hits = [...list.querySelectorAll("button")];
  const at = hits.indexOf(event.target as HTMLButtonElement);
  const to = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: hits.length - 1 }[event.key];
  if (to === undefined || at < 0) return;
  event.preventDefault();
  hits[Math.min(Math.max(to, 0), hits.length - 1)].focus();
}

/** For names that no object has: what they were interpreted as, or suggestions. */
export function unknownContent(
  { unknown, name, near, inside }: FindAnswer,
  info: MapInfo,
  instead: (asked: string, name: string) => void,
): HTMLElement[] {
  const understood = [name, near, inside];
  return Object.entries(unknown).map(([asked, similar]) => {
    const is = `No object is called “${asked}”`;
    if (similar.length === 1 && understood.includes(similar[0])) {
      return el("p", { class: "quiet", text: `${is}; showing “${similar[0]}”.` });
    }
    const offered = similar.length ? similar : commonest(info);
    const intro = similar.length ? "Did you mean:" : "This map has:";
    return el(
      "section",
      { class: "unknown" },
      el("p", { text: `${is}. ${offered.length ? intro : "This map has no objects."}` }),
      el(
        "div",
        { class: "buttons choices" },
        ...offered.slice(0, MOST_OFFERED).map((name) =>
          el("button", {
            type: "button",
            class: "button small",
            text: name,
            onclick: () => instead(asked, name),
          }),
        ),
      ),
    );
  });
}

const MOST_OFFERED = 8;

function commonest(info: MapInfo): string[] {
  const classes = info.layers.flatMap((layer) => layer.classes);
  return [...new Set(classes.sort((a, b) => b.count - a.count).map(({ name }) => name))];
}

/** A question in words: "cup within 1 m of table, inside kitchen". */
export function wantedInWords({ name, near, within, inside, ring }: ObjectQuery): string {
  const named = typeof near === "string" ? near : null;
  const parts = [
    within !== null
      ? `within ${trim(String(within))} m of ${named ?? "here"}`
      : named && `near ${named}`,
    inside !== null && `inside ${inside}`,
    ring !== null && "in the area",
  ].filter((part) => typeof part === "string");
  return [name ?? "Anything", parts.join(", ")].filter(Boolean).join(" ");
}
