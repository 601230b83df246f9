/** Grid lines at equal distances in the chosen frame, with coordinates at the map's edge. */

import Layer from "ol/layer/Layer.js";
import type { FrameState } from "ol/Map.js";
import { niceLength, trim } from "./format";
import { fromBase, toBase } from "./frames";
import { FONT } from "./looks";
import { cssColor } from "./settings";
import type { Frame, Point } from "./source";

/** Approximate distance between two lines. */
const PIXELS = 130;

export interface Edges {
  left: number;
  bottom: number;
}

export class GridLines extends Layer {
  /** Not the canvas itself: the layers above would draw on it, too. */
  private readonly element = document.createElement("div");
  private readonly canvas = document.createElement("canvas");
  frame: Frame = { frame_id: "", x: 0, y: 0, yaw: 0 };

  constructor(private readonly edges: () => Edges) {
    super({});
    this.element.className = "grid-lines";
    this.element.append(this.canvas);
  }

  override render(state: FrameState | null): HTMLElement {
    if (state) this.draw(state);
    return this.element;
  }

  private draw(state: FrameState): void {
    const { size, pixelRatio, viewState } = state;
    const [width, height] = size;
    this.canvas.width = width * pixelRatio;
    this.canvas.height = height * pixelRatio;
    const context = this.canvas.getContext("2d");
    if (!context) return;
    context.scale(pixelRatio, pixelRatio);
    const { center, resolution } = viewState;
    const toPixel = (point: Point): Point => {
      const [x, y] = toBase(this.frame, point);
      return [(x - center[0]) / resolution + width / 2, (center[1] - y) / resolution + height / 2];
    };
    const toFrame = ([column, row]: Point): Point => {
      const x = center[0] + (column - width / 2) * resolution;
      const y = center[1] - (row - height / 2) * resolution;
      return fromBase(this.frame, [x, y]);
    };
    const corners = [
      toFrame([0, 0]),
      toFrame([width, 0]),
      toFrame([0, height]),
      toFrame([width, height]),
    ];
    const step = niceLength(PIXELS * resolution);
    context.lineWidth = 1;
    context.strokeStyle = cssColor("--grid");
    const { left, bottom } = this.edges();
    const labels: { text: string; at: Point; align: CanvasTextAlign }[] = [];
    for (const axis of [0, 1] as const) {
      const across = corners.map((corner) => corner[axis]);
      const along = corners.map((corner) => corner[1 - axis]);
      const [low, high] = [Math.min(...along), Math.max(...along)];
      const last = Math.floor(Math.max(...across) / step);
      for (let k = Math.ceil(Math.min(...across) / step); k <= last; k++) {
        const point = (other: number): Point =>
          axis === 0 ? [k * step, other] : [other, k * step];
        const [a, b] = [toPixel(point(low)), toPixel(point(high))];
        context.beginPath();
        context.moveTo(snap(a[0], a[0] === b[0]), snap(a[1], a[1] === b[1]));
        context.lineTo(snap(b[0], a[0] === b[0]), snap(b[1], a[1] === b[1]));
        context.stroke();
        const text = `${trim((k * step).toFixed(4)).replace("-", "−")} m`;
        const at = axis === 0 ? crossing(a, b, 1, height - bottom) : crossing(a, b, 0, left);
        if (at) labels.push({ text, at, align: axis === 0 ? "center" : "left" });
      }
    }
    context.font = `500 11px ${FONT}`;
    context.textBaseline = "middle";
    context.lineWidth = 3;
    context.lineJoin = "round";
    context.strokeStyle = cssColor("--halo");
    context.fillStyle = cssColor("--grid-label");
    for (const { text, at, align } of labels) {
      if (align === "center" && at[0] < left + 20) continue;
      context.textAlign = align;
      context.strokeText(text, ...at);
      context.fillText(text, ...at);
    }
  }
}

/** Straight lines on whole pixels, so that they are sharp. */
const snap = (value: number, straight: boolean): number =>
  straight ? Math.round(value) + 0.5 : value;

/** Where a line crosses a row (axis 1) or column (axis 0) of the screen. */
function crossing(a: Point, b: Point, axis: 0 | 1, at: number): Point | null {
  const run = b[axis] - a[axis];
  if (Math.abs(run) < 1e-9) return null;
  const t = (at - a[axis]) / run;
  if (t < 0 || t > 1) return null;
  return axis === 1 ? [a[0] + t * (b[0] - a[0]), at] : [at, a[1] + t * (b[1] - a[1])];
}
