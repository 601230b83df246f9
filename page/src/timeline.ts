/** Observations over time: a stroke for each, whose length is the detector's score. */

import type { Seen } from "./source";

export interface Timeline {
  element: SVGSVGElement;
  choose(index: number | null): void;
}

const [WIDTH, HEIGHT, FOOT, EDGE] = [340, 58, 17, 4];
const SVG = "http://www.w3.org/2000/svg";

/** A timeline of observations in chronological order; a click selects the nearest one. */
export function timeline(
  observations: Seen[],
  timeOf: (stamp: number) => string,
  chosen: (index: number) => void,
): Timeline {
  const first = observations[0].stamp;
  const last = observations[observations.length - 1].stamp;
  const span = last - first;
  const x = (stamp: number) =>
    span > 0 ? EDGE + ((stamp - first) / span) * (WIDTH - 2 * EDGE) : WIDTH / 2;
  const ground = HEIGHT - FOOT;
  const element = svg("svg", { class: "timeline", viewBox: `0 0 ${WIDTH} ${HEIGHT}` });
  element.setAttribute("aria-hidden", "true"); // the slider below says the same
  element.append(svg("path", { class: "ground", d: `M0 ${ground}H${WIDTH}` }));
  const looks = observations.map(({ stamp, score }) => {
    const top = ground - 4 - score * (ground - 8);
    return svg("path", { class: "look", d: `M${x(stamp)} ${ground - 2}V${top}` });
  });
  const group = svg("g", {});
  group.append(...looks);
  element.append(group);
  const label = (at: number, anchor: string, stamp: number) => {
    const text = svg("text", { x: String(at), y: String(HEIGHT - 3), "text-anchor": anchor });
    text.textContent = timeOf(stamp).replace(/^at /, "");
    element.append(text);
  };
  if (span > 0) {
    label(0, "start", first);
    label(WIDTH, "end", last);
  } else label(WIDTH / 2, "middle", first);
  element.addEventListener("click", ({ clientX }) => {
    const { left, width } = element.getBoundingClientRect();
    const at = ((clientX - left) / width) * WIDTH;
    const away = observations.map(({ stamp }) => Math.abs(x(stamp) - at));
    chosen(away.indexOf(Math.min(...away)));
  });
  return {
    element,
    choose(index) {
      group.classList.toggle("one", index !== null);
      looks.forEach((look, i) => look.classList.toggle("chosen", i === index));
    },
  };
}

function svg<K extends "svg" | "path" | "g" | "text">(
  tag: K,
  attributes: Record<string, string>,
): SVGElementTagNameMap[K] {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}
