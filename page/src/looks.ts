/** How shapes and marks are drawn. */

import Feature, { type FeatureLike } from "ol/Feature.js";
import type Geometry from "ol/geom/Geometry.js";
import LineString from "ol/geom/LineString.js";
import MultiLineString from "ol/geom/MultiLineString.js";
import MultiPoint from "ol/geom/MultiPoint.js";
import type MultiPolygon from "ol/geom/MultiPolygon.js";
import PointGeometry from "ol/geom/Point.js";
import CircleStyle from "ol/style/Circle.js";
import Fill from "ol/style/Fill.js";
import Stroke from "ol/style/Stroke.js";
import Style from "ol/style/Style.js";
import Text from "ol/style/Text.js";
import { GAP, SIDES, STEP, type Side } from "./labels";
import { cssColor } from "./settings";

export const FONT = `system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif`;
const LONGEST_LABEL = 40;

export function withAlpha(color: string, alpha: number): string {
  const byte = Math.round(alpha * 255);
  return `${color}${byte.toString(16).padStart(2, "0")}`;
}

/** Mixes a share of another color into a color; an invalid color changes nothing. */
export function mixed(color: string, other: string, share: number): string {
  if (!other) return color;
  const parts = (text: string) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16));
  const from = parts(other);
  const to = parts(color).map((part, i) => Math.round(part + share * (from[i] - part)));
  return `#${to.map((part) => part.toString(16).padStart(2, "0")).join("")}`;
}

export function shortened(name: string, longest = LONGEST_LABEL): string {
  const letters = [...name.replace(/\s+/g, " ")];
  return letters.length <= longest
    ? letters.join("")
    : `${letters.slice(0, longest - 1).join("")}…`;
}

/** The layer whose objects are rooms. */
export const ROOMS = "rooms";
/** Opacity of a room's fill, through which walls and furniture are visible. */
const ROOM_ALPHA = 0.45;

/** A class of objects: its shape in the color of the legend, and its name with a halo. */
export function classLook(
  name: string,
  color: string,
  labelSize: number | null,
  isRoom = false,
): ClassLook {
  const edge = mixed(color, cssColor("--edge"), 0.45);
  const shape = new Style({
    fill: new Fill({ color: isRoom ? withAlpha(color, ROOM_ALPHA) : color }),
    stroke: new Stroke({ color: edge, width: 1.5 }),
  });
  if (labelSize === null) return { shape, size: null, labels: null };
  const text = shortened(name);
  const font = `500 ${labelSize}px ${FONT}`;
  const height = 1.25 * labelSize;
  const labels = Object.fromEntries(
    SIDES.map((side) => [side, labelLook(text, font, side, height)]),
  ) as Record<Side, Style>;
  return { shape, size: [widthOf(text, font) + 2, height], labels };
}

/** A name on one side of its shape. */
function labelLook(text: string, font: string, side: Side, height: number): Style {
  const beside = { right: [1, 0], above: [0, 1], below: [0, -1], left: [-1, 0] };
  const isOn = side === "on" || side === "low" || side === "high";
  const [x, y] = isOn ? [0, 0] : beside[side];
  const lower = side === "low" ? STEP * height : side === "high" ? -STEP * height : 0;
  return new Style({
    geometry: (feature) => {
      const at = (feature as Feature).get("at") as Geometry;
      const shape = (feature as Feature).getGeometry();
      if (isOn || !shape) return at;
      const [x0, y0, x1, y1] = shape.getExtent();
      return new PointGeometry([(x0 + x1 + x * (x1 - x0)) / 2, (y0 + y1 + y * (y1 - y0)) / 2]);
    },
    text: new Text({
      text,
      font,
      textAlign: x > 0 ? "left" : x < 0 ? "right" : "center",
      textBaseline: y > 0 ? "bottom" : y < 0 ? "top" : "middle",
      offsetX: x * GAP,
      offsetY: lower - y * GAP,
      fill: new Fill({ color: cssColor("--label") }),
      stroke: new Stroke({ color: cssColor("--halo"), width: 3, lineJoin: "round" }),
      overflow: true,
      padding: isOn ? [2, 4, 2, 4] : [0, 0, 0, 0],
    }),
  });
}

const canvas = document.createElement("canvas").getContext("2d");

function widthOf(text: string, font: string): number {
  if (!canvas) return 0;
  canvas.font = font;
  return canvas.measureText(text).width;
}

export interface ClassLook {
  shape: Style;
  /** Height of the name [pixels]; null if names are off. */
  size: [number, number] | null;
  labels: Record<Side, Style> | null;
}

/** The queried place: a ring with a point in it. */
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

/** The path between two places, with a point at its end. */
export function pathLook(): Style[] {
  const accent = cssColor("--accent");
  return [
    new Style({ stroke: new Stroke({ color: cssColor("--halo"), width: 7 }) }),
    new Style({ stroke: new Stroke({ color: accent, width: 3.5 }) }),
    new Style({
      geometry: (feature) =>
        new PointGeometry(((feature as Feature).getGeometry() as LineString).getLastCoordinate()),
      image: new CircleStyle({
        radius: 6,
        fill: new Fill({ color: accent }),
        stroke: new Stroke({ color: cssColor("--halo"), width: 2.5 }),
      }),
    }),
  ];
}

const [HEAD, OPENING] = [11, 0.45]; // of an arrow: its length [pixels], half its angle [rad]

/** What changed in a version: as it was, dashed; as it is then; or an arrow from one to the other. */
export function changeLook(feature: FeatureLike, resolution: number): Style[] {
  const [color, part] = [feature.get("color") as string, feature.get("part") as string];
  const geometry = part === "arrow" ? arrowShape(feature as Feature, resolution) : undefined;
  const line = (color: string, width: number, lineDash?: number[]) =>
    new Style({ stroke: new Stroke({ color, width, lineDash }), geometry });
  return [line(cssColor("--halo"), 6), line(color, 3, part === "before" ? [4, 6] : undefined)];
}

/** A line with a head, which is as large at every zoom. */
function arrowShape(feature: Feature, resolution: number): Geometry {
  const [start, end] = (feature.getGeometry() as LineString).getCoordinates();
  const angle = Math.atan2(start[1] - end[1], start[0] - end[0]);
  const wing = (turn: number) => [
    end[0] + HEAD * resolution * Math.cos(angle + turn),
    end[1] + HEAD * resolution * Math.sin(angle + turn),
  ];
  return new MultiLineString([
    [start, end],
    [wing(OPENING), end, wing(-OPENING)],
  ]);
}

/** A door: a white line with dark borders, as in pictures. */
export function doorLook(): Style[] {
  const line = (color: string, width: number) =>
    new Style({ stroke: new Stroke({ color, width, lineCap: "butt" }) });
  return [line("#1d2530", 6), line("#ffffff", 3)];
}

/** A line of equal value, with the value on it. */
export function contourLook(text: string): Style {
  return new Style({
    stroke: new Stroke({ color: cssColor("--edge"), width: 1 }),
    text: new Text({
      text,
      font: `11px ${FONT}`,
      placement: "line",
      fill: new Fill({ color: cssColor("--label") }),
      stroke: new Stroke({ color: cssColor("--halo"), width: 3, lineJoin: "round" }),
    }),
  });
}

/** The queried area. */
export function areaLook(): Style[] {
  return [
    new Style({ stroke: new Stroke({ color: cssColor("--halo"), width: 4 }) }),
    new Style({
      fill: new Fill({ color: withAlpha(cssColor("--accent"), 0.1) }),
      stroke: new Stroke({ color: cssColor("--accent"), width: 2, lineDash: [7, 5] }),
    }),
  ];
}

/** What of an area is not covered by the camera. */
export function restLook(): Style {
  return new Style({ fill: new Fill({ color: withAlpha(cssColor("--accent"), 0.45) }) });
}

/** The selected object. */
export function chosenLook(): Style[] {
  return [
    new Style({ stroke: new Stroke({ color: cssColor("--halo"), width: 7 }) }),
    new Style({
      fill: new Fill({ color: withAlpha(cssColor("--accent"), 0.18) }),
      stroke: new Stroke({ color: cssColor("--accent"), width: 3 }),
    }),
  ];
}

/** Distance of the rotation handle above a shape [pixels]. */
const HANDLE = 30;

export function turnHandle(shape: MultiPolygon, resolution: number): [number, number] {
  const [x0, , x1, y1] = shape.getExtent();
  return [(x0 + x1) / 2, y1 + HANDLE * resolution];
}

/** The object being edited, its corners, and the rotation handle. */
export function editedLook(resolution: number): Style[] {
  const corners = new Style({
    geometry: (feature) => {
      const shape = (feature as Feature).getGeometry() as MultiPolygon;
      return new MultiPoint(shape.getCoordinates().flat(2));
    },
    image: new CircleStyle({
      radius: 5,
      fill: new Fill({ color: cssColor("--card") }),
      stroke: new Stroke({ color: cssColor("--accent"), width: 2 }),
    }),
  });
  const shapeOf = (feature: unknown) => (feature as Feature).getGeometry() as MultiPolygon;
  const arm = new Style({
    geometry: (feature) => {
      const [x, y] = turnHandle(shapeOf(feature), resolution);
      return new LineString([
        [x, y],
        [x, y - HANDLE * resolution],
      ]);
    },
    stroke: new Stroke({ color: cssColor("--accent"), width: 1.5 }),
  });
  const handle = new Style({
    geometry: (feature) => new PointGeometry(turnHandle(shapeOf(feature), resolution)),
    image: new CircleStyle({
      radius: 7,
      fill: new Fill({ color: cssColor("--accent") }),
      stroke: new Stroke({ color: cssColor("--card"), width: 2 }),
    }),
  });
  return [...chosenLook(), corners, arm, handle];
}

/** A note: its number in a disc, or the outline of its area. */
export function noteLook(number: number | null, isShown: boolean): Style[] {
  const color = cssColor("--note");
  if (number === null)
    return [new Style({ stroke: new Stroke({ color, width: 2, lineDash: [6, 4] }) })];
  return [
    new Style({
      image: new CircleStyle({
        radius: isShown ? 13 : 10,
        fill: new Fill({ color: isShown ? cssColor("--ink") : color }),
        stroke: new Stroke({ color: cssColor("--halo"), width: 2 }),
      }),
      text: new Text({
        text: String(number),
        font: `700 11px ${FONT}`,
        fill: new Fill({ color: cssColor(isShown ? "--card" : "--on-note") }),
      }),
      zIndex: isShown ? 1 : 0,
    }),
  ];
}

/** One of the matches: its rank in a disc. */
export function matchLook(rank: number, isLookedAt: boolean): Style[] {
  return [
    new Style({
      image: new CircleStyle({
        radius: isLookedAt ? 13 : 10,
        displacement: [0, 17],
        fill: new Fill({ color: cssColor(isLookedAt ? "--ink" : "--accent") }),
        stroke: new Stroke({ color: cssColor("--halo"), width: 2.5 }),
      }),
      text: new Text({
        text: String(rank),
        font: `700 11px ${FONT}`,
        offsetY: -17,
        fill: new Fill({ color: cssColor(isLookedAt ? "--card" : "--on-accent") }),
      }),
      zIndex: isLookedAt ? 1 : -rank,
    }),
  ];
}
