/** Styles of an object's evidence: shapes, cameras, and outlines with different dashes. */

import LineString from "ol/geom/LineString.js";
import Fill from "ol/style/Fill.js";
import RegularShape from "ol/style/RegularShape.js";
import Stroke from "ol/style/Stroke.js";
import Style from "ol/style/Style.js";
import { withAlpha } from "./looks";
import { cssColor } from "./settings";
import type { Point, Seen } from "./source";

export interface OutlineLook {
  title: string;
  about: string;
  /** Name of the color in the style sheet. */
  color: string;
  dash: number[];
}

/** The shape in the map, and the one that each method computes from the evidence. */
export const OUTLINES: Record<string, OutlineLook> = {
  in_map: {
    title: "Shape in the map",
    about: "The shape of the object in the map",
    color: "--accent",
    dash: [],
  },
  votes: {
    title: "Votes of the views",
    about: "The convex hull of the cells that enough views agree on",
    color: "--votes",
    dash: [11, 9],
  },
  best_shape: {
    title: "Central shape",
    about: "The observed shape whose centroid is nearest to the mean of all",
    color: "--best-shape",
    dash: [1, 7],
  },
  convex_hull: {
    title: "Hull of all shapes",
    about: "The convex hull of all observed shapes",
    color: "--convex-hull",
    dash: [13, 8, 1, 8],
  },
};

export const lookOf = (method: string): OutlineLook =>
  OUTLINES[method] ?? { title: method, about: method, color: "--ink", dash: [5, 7] };

/** Puts all that is not evidence into the background. */
export function veilLook(): Style {
  return new Style({ fill: new Fill({ color: withAlpha(cssColor("--paper"), 0.6) }) });
}

export function outlineLook(method: string): Style[] {
  const { color, dash } = lookOf(method);
  const stroke = { color: cssColor(color), width: 3, lineDash: dash };
  const line = new Style({ stroke: new Stroke({ ...stroke, lineCap: "round" }) });
  // The others lie on this one; where they agree with it, it shows between the dashes.
  return method === "in_map"
    ? [new Style({ stroke: new Stroke({ color: cssColor("--halo"), width: 7 }) }), line]
    : [line];
}

/** An observed shape: opaque if the detector was certain; each is fainter if there are many. */
export function seenLook({ score }: Seen, many: number, isFaint: boolean): Style {
  const accent = cssColor("--accent");
  const share = isFaint ? 0.25 : 1;
  const fill = Math.min(0.2, (1.1 * score) / Math.max(many, 4));
  return new Style({
    fill: new Fill({ color: withAlpha(accent, share * fill) }),
    stroke: new Stroke({
      color: withAlpha(accent, share * (0.12 + 0.55 * score)),
      width: 1.3,
    }),
  });
}

/** The observation in question, with the line from its camera. */
export function chosenSeenLook(camera: Point, middle: Point): Style[] {
  const ink = cssColor("--ink");
  return [
    new Style({
      geometry: new LineString([camera, middle]),
      stroke: new Stroke({ color: withAlpha(ink, 0.6), width: 1.5, lineDash: [2, 5] }),
    }),
    new Style({ stroke: new Stroke({ color: cssColor("--halo"), width: 6 }) }),
    new Style({
      fill: new Fill({ color: withAlpha(ink, 0.18) }),
      stroke: new Stroke({ color: ink, width: 2.6 }),
    }),
  ];
}

/** A camera: a wedge that points where it looked. */
export function cameraLook(yaw: number, kind: "plain" | "chosen" | "faint"): Style {
  const color = cssColor(kind === "chosen" ? "--ink" : "--accent");
  return new Style({
    image: new RegularShape({
      points: 3,
      radius: kind === "chosen" ? 10 : 7,
      rotation: Math.PI / 2 - yaw,
      rotateWithView: false,
      scale: [0.75, 1],
      fill: new Fill({ color: withAlpha(color, kind === "faint" ? 0.2 : 0.8) }),
      stroke: new Stroke({ color: withAlpha(cssColor("--halo"), 0.9), width: 1.2 }),
    }),
    zIndex: kind === "chosen" ? 1 : 0,
  });
}
