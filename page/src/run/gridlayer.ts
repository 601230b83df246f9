/** The grid at a step: one picture, which is loaded before it is shown. */

import type { FrameState } from "ol/Map.js";
import Layer from "ol/layer/Layer.js";
import type { Extent } from "../source";

export class GridLayer extends Layer {
  /** Not the canvas itself: the layers above would draw on it, too. */
  private readonly element = document.createElement("div");
  private readonly canvas = document.createElement("canvas");
  private shown: { picture: HTMLImageElement; extent: Extent } | null = null;

  constructor() {
    super({});
    this.element.className = "grid-lines raster";
    this.element.append(this.canvas);
  }

  show(picture: HTMLImageElement, extent: Extent): void {
    this.shown = { picture, extent };
    this.changed();
  }

  override render(state: FrameState | null): HTMLElement {
    if (state) this.draw(state);
    return this.element;
  }

  private draw({ size: [width, height], pixelRatio, viewState }: FrameState): void {
    this.canvas.width = width * pixelRatio;
    this.canvas.height = height * pixelRatio;
    const context = this.canvas.getContext("2d");
    if (!context || !this.shown) return;
    const { center, resolution } = viewState;
    const [x0, y0, x1, y1] = this.shown.extent;
    const left = (x0 - center[0]) / resolution + width / 2;
    const top = (center[1] - y1) / resolution + height / 2;
    context.scale(pixelRatio, pixelRatio);
    context.imageSmoothingEnabled = false;
    const { picture } = this.shown;
    context.drawImage(picture, left, top, (x1 - x0) / resolution, (y1 - y0) / resolution);
  }
}
