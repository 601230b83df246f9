/** The page on paper: a picture of the map with title, date, scale bar and legend. */

import type OpenLayersMap from "ol/Map.js";
import { byId, el } from "./dom";
import { length, niceLength, stamp } from "./format";
import { legend, swatch } from "./layers";
import { FONT } from "./looks";
import { drawnLayer, isVisible, type MapView, type ShownLayer } from "./mapview";
import type { Insets } from "./plane";
import type { Extent } from "./source";

/** Pixels of the picture for each one on the screen, so that names are sharp on paper. */
const SHARP = 3;
/** Height of the strip with the scale bar [pixels of the screen]. */
const STRIP = 34;
/** The scale bar is not longer than this [pixels of the screen]. */
const LONGEST = 160;
const INK = "#1d2530";

/**
 * Prepares each printing, and removes what it added afterwards.
 *
 * @param inLight - draws the map in the colors of the light theme, calls the function, and goes
 *   back to the user's theme.
 */
export function watchPrinting(
  view: MapView,
  insets: () => Insets,
  inLight: (draw: () => void) => void,
): void {
  const paper = byId("paper");
  window.addEventListener("beforeprint", () => {
    const { left, right } = insets();
    inLight(() => paper.replaceChildren(head(), picture(view.map, left, right), legendOf(view)));
  });
  window.addEventListener("afterprint", () => paper.replaceChildren());
}

function head(): HTMLElement {
  const text = (id: string) => byId(id).textContent ?? "";
  const printed = `printed ${stamp(Date.now() / 1000).slice(0, 16)}`;
  const parts = [text("subtitle"), printed, byId("notice").hidden ? "" : text("notice")];
  return el(
    "header",
    {},
    el("h1", { text: text("title") }),
    el("p", { text: parts.filter(Boolean).join(" · ") }),
  );
}

/** What the map shows between the panels, with a scale bar below it. */
function picture(map: OpenLayersMap, left: number, right: number): HTMLCanvasElement {
  const [width, height] = map.getSize() ?? [0, 0];
  const shown = Math.max(1, width - left - right);
  const canvas = el("canvas");
  [canvas.width, canvas.height] = [SHARP * shown, SHARP * (height + STRIP)];
  const context = canvas.getContext("2d");
  if (!context) return canvas;
  context.fillStyle = "#ffffff";
  context.fillRect(0, 0, canvas.width, canvas.height);
  const ratio = map.getPixelRatio();
  map.setPixelRatio(SHARP);
  map.renderSync();
  for (const drawn of byId("map").querySelectorAll<HTMLCanvasElement>(".ol-layers canvas"))
    if (drawn.width) context.drawImage(drawn, -SHARP * left, 0, SHARP * width, SHARP * height);
  map.setPixelRatio(ratio);
  context.scale(SHARP, SHARP);
  context.fillStyle = "#ffffff";
  context.fillRect(0, height, shown, STRIP);
  drawScale(context, map.getView().getResolution() ?? 1, height);
  return canvas;
}

function drawScale(context: CanvasRenderingContext2D, resolution: number, top: number): void {
  const meters = niceLength(LONGEST * resolution);
  const end = 1 + meters / resolution;
  context.strokeStyle = context.fillStyle = INK;
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(1, top + 14);
  context.lineTo(1, top + 22);
  context.lineTo(end, top + 22);
  context.lineTo(end, top + 14);
  context.stroke();
  context.font = `600 14px ${FONT}`;
  context.fillText(length(meters), end + 10, top + 23);
}

/** What the colors in the picture mean. */
function legendOf(view: MapView): HTMLElement {
  const extent = view.map.getView().calculateExtent() as Extent;
  const layers = [...view.layers.values()].reverse().filter(isVisible);
  const parts = layers.map((layer) => ({ name: layer.info.name, entries: entries(layer, extent) }));
  return el(
    "div",
    { class: "legends" },
    ...parts
      .filter(({ entries }) => entries !== null)
      .map(({ name, entries }) => el("section", {}, el("h2", { text: name }), entries)),
  );
}

function entries(layer: ShownLayer, extent: Extent): HTMLElement | null {
  const { info, shapes } = layer;
  if (!drawnLayer(layer)) return null;
  if (info.kind === "raster") return info.legend.length ? legend(info.legend) : null;
  const classes = shapes?.classesIn(extent) ?? [];
  const rows = classes.map(({ name, color }) =>
    el("li", {}, swatch(color), el("span", { text: name })),
  );
  return rows.length ? el("ul", { class: "legend" }, ...rows) : null;
}
