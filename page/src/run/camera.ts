/** Camera image: its picture with the segments and boxes of what was detected. */

import { FONT, shortened, withAlpha } from "../looks";
import type { Detection, Observation } from "./steps";

const LABEL = 12; // pixels
const LONGEST = 24; // letters of a name
const TINT = 0.5;

export interface CameraOptions {
  boxes: boolean;
  segments: boolean;
}

export class CameraView {
  private shown: { observation: Observation; picture: HTMLImageElement } | null = null;
  private colors: Record<string, string> = {};

  constructor(
    private readonly canvas: HTMLCanvasElement,
    readonly options: CameraOptions,
  ) {
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  show(observation: Observation, picture: HTMLImageElement, colors: Record<string, string>): void {
    this.shown = { observation, picture };
    this.colors = colors;
    const { width, height, kind } = observation.picture;
    this.canvas.style.aspectRatio = `${width} / ${height}`;
    const found = observation.detections.map(({ name, score }) => `${name} ${percent(score)}`);
    this.canvas.setAttribute(
      "aria-label",
      `${kind === "color" ? "Color" : "Depth"} picture; detected: ${found.join(", ") || "nothing"}`,
    );
    this.draw();
  }

  draw(): void {
    const context = this.canvas.getContext("2d");
    const { clientWidth } = this.canvas;
    if (!context || !this.shown || !clientWidth) return;
    const { observation, picture } = this.shown;
    const { width, height } = observation.picture;
    const ratio = window.devicePixelRatio;
    this.canvas.width = Math.round(clientWidth * ratio);
    this.canvas.height = Math.round((clientWidth * ratio * height) / width);
    context.imageSmoothingQuality = "high";
    context.drawImage(picture, 0, 0, this.canvas.width, this.canvas.height);
    const scale = clientWidth / width;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    // The most certain one comes last, on top.
    const detections = [...observation.detections].sort((a, b) => a.score - b.score);
    if (this.options.segments) {
      context.imageSmoothingEnabled = false;
      for (const detection of detections) this.tint(context, detection, width, height, scale);
    }
    if (!this.options.boxes) return;
    for (const detection of detections) this.frame(context, detection, scale);
    for (const detection of detections) this.name(context, detection, scale);
  }

  private color({ name }: Detection): string {
    return this.colors[name] ?? "#808080";
  }

  private tint(
    context: CanvasRenderingContext2D,
    detection: Detection,
    width: number,
    height: number,
    scale: number,
  ): void {
    if (!detection.runs.length) return;
    const mask = new OffscreenCanvas(width, height);
    const inside = mask.getContext("2d");
    if (!inside) return;
    inside.fillStyle = withAlpha(this.color(detection), TINT);
    for (let i = 0; i < detection.runs.length; i += 3) {
      inside.fillRect(detection.runs[i], detection.runs[i + 1], detection.runs[i + 2], 1);
    }
    context.drawImage(mask, 0, 0, width * scale, height * scale);
  }

  private frame(context: CanvasRenderingContext2D, detection: Detection, scale: number): void {
    if (!detection.box) return;
    const [x0, y0, x1, y1] = detection.box.map((side) => side * scale);
    const box = [x0, y0, x1 - x0, y1 - y0] as const;
    context.lineJoin = "round";
    context.strokeStyle = "rgb(255 255 255 / 75%)";
    context.lineWidth = 4;
    context.strokeRect(...box);
    context.strokeStyle = this.color(detection);
    context.lineWidth = 2;
    context.strokeRect(...box);
  }

  private name(context: CanvasRenderingContext2D, detection: Detection, scale: number): void {
    if (!detection.box) return;
    const text = `${shortened(detection.name, LONGEST)} ${percent(detection.score)}`;
    context.font = `600 ${LABEL}px ${FONT}`;
    const [width, height] = [context.measureText(text).width + 10, LABEL + 7];
    const right = this.canvas.clientWidth - width;
    const x = Math.max(0, Math.min(right, detection.box[0] * scale - 1));
    const above = detection.box[1] * scale - height;
    const y = above >= 0 ? above : detection.box[1] * scale + 1;
    context.fillStyle = this.color(detection);
    context.beginPath();
    context.roundRect(x, y, width, height, 4);
    context.fill();
    context.fillStyle = "#ffffff";
    context.textBaseline = "middle";
    context.fillText(text, x + 5, y + height / 2 + 0.5);
  }
}

export const percent = (score: number): string => `${Math.round(100 * score)} %`;
