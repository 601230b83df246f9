/** The status line of the map: axes, scale bar, coordinates under the pointer, and their frame. */

import { byId, el } from "./dom";
import { meters } from "./format";
import { fromBase } from "./frames";
import { showScale } from "./scalebar";
import type { Frame, Point } from "./source";

export class StatusLine {
  private readonly select = byId<HTMLSelectElement>("frame");
  private readonly axes = axesPicture();
  private frame: Frame | null = null;
  private pointer: Point | null = null;
  private resolution = 1;

  constructor(chosen: (frame: string) => void) {
    byId("axes").replaceChildren(this.axes);
    this.select.addEventListener("change", () => chosen(this.select.value));
  }

  setFrames(frames: Frame[], chosen: Frame): void {
    this.frame = chosen;
    this.select.replaceChildren(
      ...frames.map(({ frame_id }) => el("option", { value: frame_id, text: frame_id })),
    );
    this.select.value = chosen.frame_id;
    const turned = this.axes.querySelector("g");
    turned?.setAttribute("transform", `rotate(${(-chosen.yaw * 180) / Math.PI})`);
    byId("axes").title = `Axes of ${chosen.frame_id}: x red, y green`;
    this.write();
  }

  setPointer(point: Point | null): void {
    this.pointer = point;
    this.write();
  }

  setResolution(resolution: number): void {
    this.resolution = resolution;
    showScale(resolution);
    this.write();
  }

  private write(): void {
    const output = byId("coordinates");
    if (!this.pointer || !this.frame) {
      output.textContent = "x –  y –";
      return;
    }
    const resolution = Math.min(0.1, this.resolution);
    const [x, y] = fromBase(this.frame, this.pointer).map((v) => meters(v, resolution));
    output.textContent = `x ${x}  y ${y} m`;
  }
}

const SVG = "http://www.w3.org/2000/svg";

/** x to the right, y up, of a frame that is not turned. */
function axesPicture(): SVGSVGElement {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "-20 -20 40 40");
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", "Axes of the selected frame: x red, y green");
  const group = document.createElementNS(SVG, "g");
  const stroke = (className: string, d: string) => {
    const path = document.createElementNS(SVG, "path");
    path.setAttribute("d", d);
    path.classList.add(className);
    group.append(path);
  };
  stroke("axis-x", "M0 0H14M10.500 -3.500L14 0L10.500 3.500");
  stroke("axis-y", "M0 0V-14M-3.500 -10.500L0 -14L3.500 -10.500");
  svg.append(group);
  return svg;
}
