/** Answers as elements: what is at a place, in an area, under a name, and of one object. */

import { complain, el, icon, saveFile } from "./dom";
import { count, metres, plural, squareMetres, stamp, trim } from "./format";
import { swatch } from "./layers";
import type {
  AreaAnswer,
  AreaRow,
  Download,
  FindAnswer,
  FoundRow,
  MapInfo,
  ObjectDetails,
  PointAnswer,
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

export function pointContent(answer: PointAnswer, info: MapInfo, choose: Choose): HTMLElement[] {
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
      objects.length
        ? el(
            "ul",
            { class: "objects" },
            ...objects.map((object) =>
              el(
                "li",
                {},
                el(
                  "button",
                  { type: "button", class: "object", onclick: () => choose(name, object.id) },
                  labelled(info, name, object.name),
                  el("span", {
                    class: "quiet",
                    text: [
                      `id ${object.id}`,
                      object.area === undefined ? "" : squareMetres(object.area),
                    ]
                      .filter(Boolean)
                      .join(" · "),
                  }),
                  icon("chevron"),
                ),
              ),
            ),
          )
        : null,
    );
  });
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
    { title: "Area", key: (row) => row.area, text: (row) => squareMetres(row.area), numeric: true },
    { title: "x", key: (row) => row.x, text: (row) => metres(row.x), numeric: true },
    { title: "y", key: (row) => row.y, text: (row) => metres(row.y), numeric: true },
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
            text: `${about ? "about " : ""}${count(n)} · ${squareMetres(area)}`,
          }),
        );
      }),
    ),
  );
}

export function findContent(
  answer: FindAnswer,
  info: MapInfo,
  choose: (row: FoundRow) => void,
): HTMLElement[] {
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
          data: { id: String(found.id) },
          onclick: () => choose(found),
        },
        el("span", { class: "rank", text: String(rank + 1) }),
        labelled(info, found.layer, found.name),
        el("span", {
          class: "quiet",
          text: [several ? found.layer : "", `${metres(found.distance)} m`]
            .filter(Boolean)
            .join(" · "),
        }),
        icon("chevron"),
      ),
    );
  return [el("ol", { class: "objects found" }, ...answer.rows.map(row))];
}

export function objectContent(object: ObjectDetails): HTMLElement[] {
  const { area, at, tags, confidence, existence, first_seen, last_seen } = object;
  const known: Record<string, unknown> = {
    existence,
    confidence: confidence?.length ? confidence : null,
    first_seen,
    last_seen,
    ...object.attributes,
  };
  const facts: [string, string][] = [
    ["Area", squareMetres(area)],
    ["Middle", `${metres(at[0])}, ${metres(at[1])} m`],
    ...(tags.length ? [["Tags", tags.join(", ")] as [string, string]] : []),
    ...Object.entries(known)
      .filter(([, value]) => value !== null && value !== undefined && value !== "")
      .map(([key, value]): [string, string] => [heading(key), said(key, value)]),
  ];
  return [
    el(
      "dl",
      { class: "facts" },
      ...facts.flatMap(([key, value]) => [el("dt", { text: key }), el("dd", { text: value })]),
    ),
  ];
}

function heading(key: string): string {
  const text = key.replaceAll("_", " ");
  return text.charAt(0).toUpperCase() + text.slice(1);
}

function said(key: string, value: unknown): string {
  if (typeof value === "number")
    return key.endsWith("_seen") ? stamp(value) : trim(value.toFixed(4));
  if (typeof value === "string") return value;
  if (!Array.isArray(value) || value.length === 0) return JSON.stringify(value);
  return value.map((one: unknown) => said("", one)).join(", ");
}
