/** How shapes and marks are drawn. */

import Feature from "ol/Feature.js";
import type Geometry from "ol/geom/Geometry.js";
import CircleStyle from "ol/style/Circle.js";
import Fill from "ol/style/Fill.js";
import Stroke from "ol/style/Stroke.js";
import Style from "ol/style/Style.js";
import Text from "ol/style/Text.js";
import { cssColor } from "./settings";

export const FONT = `system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif`;
const LONGEST_LABEL = 40;

export function withAlpha(color: string, alpha: number): string {
  const byte = Math.round(alpha * 255);
  return `${color}${byte.toString(16).padStart(2, "0")}`;
}

export function shortened(name: string): string {
  const letters = [...name.replace(/\s+/g, " ")];
  return letters.length <= LONGEST_LABEL
    ? letters.join("")
    : `${letters.slice(0, LONGEST_LABEL - 1).join("")}…`;
}

/** A class of objects: its filled shape, and its label with a halo. */
export function classLook(name: string, color: string, labelSize: number | null): ClassLook {
  const shape = new Style({
    fill: new Fill({ color: withAlpha(color, 0.62) }),
    stroke: new Stroke({ color, width: 1.5 }),
    image: new CircleStyle({ radius: 2, fill: new Fill({ color }) }),
  });
  if (labelSize === null) return { shape, label: null };
  const label = new Style({
    geometry: (feature) => (feature as Feature).get("at") as Geometry,
    text: new Text({
      text: shortened(name),
      font: `500 ${labelSize}px ${FONT}`,
      fill: new Fill({ color: cssColor("--label") }),
      stroke: new Stroke({ color: cssColor("--halo"), width: 3, lineJoin: "round" }),
      overflow: true,
      padding: [2, 4, 2, 4],
    }),
  });
  return { shape, label };
}

export interface ClassLook {
  shape: Style;
  label: Style | null;
}

/** The asked place: a ring with a point in it. */
export function placeLook(): Style[] {
  const accent = cssColor("--accent");
  const ring = (radius: number, color: string, width: number) =>
    new Style({
      image: new CircleStyle({ radius, stroke: new Stroke({ color, width }) }),
    });
  return [
    ring(9, cssColor("--halo"), 5),
    ring(9, accent, 2.5),
    new Style({ image: new CircleStyle({ radius: 2.5, fill: new Fill({ color: accent }) }) }),
  ];
}

/** The asked area. */
export function areaLook(): Style[] {
  return [
    new Style({ stroke: new Stroke({ color: cssColor("--halo"), width: 4 }) }),
    new Style({
      fill: new Fill({ color: withAlpha(cssColor("--accent"), 0.1) }),
      stroke: new Stroke({ color: cssColor("--accent"), width: 2, lineDash: [7, 5] }),
    }),
  ];
}

/** The chosen object. */
export function chosenLook(): Style[] {
  return [
    new Style({ stroke: new Stroke({ color: cssColor("--halo"), width: 7 }) }),
    new Style({
      fill: new Fill({ color: withAlpha(cssColor("--accent"), 0.18) }),
      stroke: new Stroke({ color: cssColor("--accent"), width: 3 }),
    }),
  ];
}

/** One of the matches: its rank in a disc. */
export function matchLook(rank: number): Style[] {
  return [
    new Style({
      image: new CircleStyle({
        radius: 10,
        fill: new Fill({ color: cssColor("--accent") }),
        stroke: new Stroke({ color: cssColor("--halo"), width: 2.5 }),
      }),
      text: new Text({
        text: String(rank),
        font: `700 11px ${FONT}`,
        fill: new Fill({ color: cssColor("--on-accent") }),
      }),
      zIndex: -rank,
    }),
  ];
}
