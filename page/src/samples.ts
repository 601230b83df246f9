/** Swatches for the legend of the evidence. */

import { lookOf } from "./evidencelooks";

const SVG = "http://www.w3.org/2000/svg";

export function lineSample(method: string): SVGSVGElement {
  const { dash } = lookOf(method);
  return sample(method === "in_map" ? "in-map" : method, "line", {
    x1: "2",
    y1: "7",
    x2: "32",
    y2: "7",
    "stroke-linecap": "round",
    "stroke-dasharray": dash.map((n) => 0.7 * n).join(" "),
  });
}

export function looksSample(): SVGSVGElement {
  return sample("looks", "rect", { x: "8", y: "1", width: "18", height: "12", rx: "2" });
}

export function cameraSample(): SVGSVGElement {
  return sample("cameras", "path", { d: "M12 2.500L22 7L12 11.500z" });
}

function sample(name: string, tag: string, attributes: Record<string, string>): SVGSVGElement {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 34 14");
  svg.setAttribute("aria-hidden", "true");
  svg.classList.add("sample", name);
  const shape = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) shape.setAttribute(key, value);
  svg.append(shape);
  return svg;
}
