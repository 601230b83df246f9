/** Styles for what a frame saw. */

import CircleStyle from "ol/style/Circle.js";
import Fill from "ol/style/Fill.js";
import Icon from "ol/style/Icon.js";
import Stroke from "ol/style/Stroke.js";
import Style from "ol/style/Style.js";
import { withAlpha } from "../looks";
import { cssColor } from "../settings";

/** The area that a frame could see. */
export function observedLook(): Style {
  const accent = cssColor("--accent");
  return new Style({
    fill: new Fill({ color: withAlpha(accent, 0.14) }),
    stroke: new Stroke({ color: withAlpha(accent, 0.45), width: 1 }),
  });
}

/** The camera path: where it was, and, fainter, where it will be. */
export function wayLook(ahead: boolean): Style {
  const accent = cssColor("--accent");
  return new Style({
    stroke: new Stroke({
      color: withAlpha(accent, ahead ? 0.3 : 0.9),
      width: 2,
      lineDash: ahead ? [2, 5] : undefined,
      lineCap: "round",
      lineJoin: "round",
    }),
  });
}

/** The shape on the floor of what a frame shows. */
export function footprintLook(color: string): Style[] {
  return [
    new Style({ stroke: new Stroke({ color: cssColor("--halo"), width: 5 }) }),
    new Style({ stroke: new Stroke({ color, width: 2.5, lineDash: [5, 4] }) }),
  ];
}

const SIZE = 96; // pixels
const REACH = 40;

/** The camera: a disc, and a wedge over what it looks at. */
export function cameraLook(yaw: number | null, width: number): Style[] {
  const disc = new Style({
    image: new CircleStyle({
      radius: 6,
      fill: new Fill({ color: cssColor("--accent") }),
      stroke: new Stroke({ color: cssColor("--halo"), width: 2.5 }),
    }),
  });
  if (yaw === null) return [disc];
  const wedge = new Icon({ img: wedgePicture(width), size: [SIZE, SIZE], rotation: -yaw });
  return [new Style({ image: wedge }), disc];
}

const wedges = new Map<string, HTMLCanvasElement>();

/** A sector to the right of the center. */
function wedgePicture(width: number): HTMLCanvasElement {
  const accent = cssColor("--accent");
  const key = `${width} ${accent}`;
  const kept = wedges.get(key);
  if (kept) return kept;
  const canvas = document.createElement("canvas");
  wedges.set(key, canvas);
  canvas.width = canvas.height = SIZE;
  const context = canvas.getContext("2d");
  if (!context) return canvas;
  const middle = SIZE / 2;
  const light = context.createRadialGradient(middle, middle, 0, middle, middle, REACH);
  light.addColorStop(0, withAlpha(accent, 0.75));
  light.addColorStop(1, withAlpha(accent, 0.1));
  context.beginPath();
  context.moveTo(middle, middle);
  context.arc(middle, middle, REACH, -width / 2, width / 2);
  context.closePath();
  context.fillStyle = light;
  context.fill();
  context.strokeStyle = accent;
  context.lineWidth = 1.5;
  context.stroke();
  return canvas;
}
