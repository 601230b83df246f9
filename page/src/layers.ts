/** The list of layers: which are shown, their opacity, and their classes. */

import { byId, el, icon } from "./dom";
import { count, length, plural } from "./format";
import { drawnLayer, isMeasured, isVisible, type MapView, type ShownLayer } from "./mapview";
import type { ClassInfo, LayerInfo } from "./source";

/** With at least this many classes, the list has a search field. */
const SEARCHED = 8;

export class LayersPanel {
  private readonly open = new Set<string>();
  private readonly words = new Map<string, string>();

  constructor(
    private readonly view: MapView,
    private readonly changed: () => void,
    /** The list of the notes of a layer. */
    private readonly notes: (layer: string) => HTMLElement,
  ) {}

  /** Redraws the list: the topmost layer first, as on the map. */
  draw(): void {
    const layers = [...this.view.layers.values()].reverse();
    if (this.open.size === 0) for (const { info } of layers) this.open.add(info.name);
    byId("layers").replaceChildren(...layers.map((layer) => this.row(layer)));
  }

  private row(shown: ShownLayer): HTMLElement {
    const { info } = shown;
    const { name } = info;
    const drawn = drawnLayer(shown);
    const box = el("input", { type: "checkbox", aria: { label: `Show layer ${name}` } });
    box.checked = isVisible(shown);
    box.disabled = !drawn;
    const row = el("li", { class: "layer", data: { layer: name } });
    box.onchange = () => {
      drawn?.setVisible(box.checked);
      row.classList.toggle("off", !box.checked);
      this.view.later();
      this.changed();
    };
    row.classList.toggle("off", !box.checked);
    const body = drawn ? this.body(shown) : null;
    row.append(
      el("div", { class: "layer-head" }, box, this.opener(shown, body)),
      ...(body ? [body] : []),
      ...(info.problem ? [el("p", { class: "quiet problem", text: info.problem })] : []),
    );
    return row;
  }

  private opener({ info }: ShownLayer, body: HTMLElement | null): HTMLElement {
    const about = aboutLayer(info);
    const text = el(
      "span",
      { class: "layer-name" },
      el("span", { class: "name", text: info.name }),
      el("span", { class: "quiet", text: about }),
    );
    if (!body) return text;
    const button = el(
      "button",
      { type: "button", class: "opener", aria: { expanded: String(this.open.has(info.name)) } },
      text,
      icon("chevron"),
    );
    body.hidden = !this.open.has(info.name);
    button.onclick = () => {
      body.hidden = !body.hidden;
      button.setAttribute("aria-expanded", String(!body.hidden));
      if (body.hidden) this.open.delete(info.name);
      else this.open.add(info.name);
    };
    return button;
  }

  private body(shown: ShownLayer): HTMLElement {
    const { info } = shown;
    const layer = drawnLayer(shown);
    const slider = el("input", { type: "range", aria: { label: `Opacity of layer ${info.name}` } });
    const percent = el("span", { class: "quiet percent" });
    const say = () => (percent.textContent = `${slider.value} %`);
    Object.assign(slider, { min: "0", max: "100", step: "5" });
    slider.value = String(Math.round((layer?.getOpacity() ?? 1) * 100));
    say();
    slider.oninput = () => {
      layer?.setOpacity(Number(slider.value) / 100);
      say();
    };
    return el(
      "div",
      { class: "layer-body" },
      el("label", { class: "slider" }, el("span", { text: "Opacity" }), slider, percent),
      info.legend.length && info.kind === "raster" && !isMeasured(info)
        ? legend(info.legend)
        : null,
      shown.shapes && info.classes.length ? this.classes(shown) : null,
      shown.notes ? this.notes(info.name) : null,
    );
  }

  private classes(shown: ShownLayer): HTMLElement {
    const { info, shapes } = shown;
    const rows = info.classes.map((one) => this.classRow(shown, one));
    const all = (hidden: boolean) => {
      const chosen = rows.filter(({ row }) => !row.hidden);
      for (const { box } of chosen) box.checked = !hidden;
      shapes?.setHidden(
        chosen.map(({ name }) => name),
        hidden,
      );
      this.view.later();
    };
    const filter = el("input", {
      type: "search",
      class: "filter",
      placeholder: `Filter ${count(rows.length)} classes`,
      aria: { label: `Filter the classes of ${info.name}` },
    });
    filter.value = this.words.get(info.name) ?? "";
    const narrow = () => {
      const word = filter.value.trim().toLowerCase();
      this.words.set(info.name, word);
      for (const { row, name } of rows) row.hidden = !name.toLowerCase().includes(word);
    };
    filter.oninput = narrow;
    narrow();
    const buttons = el(
      "div",
      { class: "all-none" },
      el("button", { type: "button", class: "link", text: "All", onclick: () => all(false) }),
      el("button", { type: "button", class: "link", text: "None", onclick: () => all(true) }),
    );
    return el(
      "div",
      { class: "classes" },
      el(
        "div",
        { class: "classes-head" },
        rows.length >= SEARCHED ? filter : el("span", { class: "quiet grow", text: "Classes" }),
        buttons,
      ),
      el("ul", {}, ...rows.map(({ row }) => row)),
    );
  }

  private classRow({ shapes }: ShownLayer, { name, color, count: n }: ClassInfo): ClassRow {
    const box = el("input", { type: "checkbox" });
    box.checked = !shapes?.hidden.has(name);
    box.onchange = () => {
      shapes?.setHidden([name], !box.checked);
      this.view.later();
    };
    const row = el(
      "li",
      { data: { class: name } },
      el(
        "label",
        { class: "class" },
        box,
        swatch(color),
        el("span", { class: "name", text: name, title: name }),
        el("span", { class: "quiet", text: count(n) }),
      ),
    );
    return { row, box, name };
  }
}

function aboutLayer({ kind, count, resolution, class_name, problem }: LayerInfo): string {
  if (problem) return "cannot be drawn";
  if (kind === "shapes") return plural(count, "object");
  if (kind === "notes") return plural(count, "note");
  if (kind === "none") return class_name;
  return resolution ? `${length(resolution)} cells` : "cells";
}

interface ClassRow {
  row: HTMLElement;
  box: HTMLInputElement;
  name: string;
}

/** A color swatch; that of a grid follows its colors in the dark theme. */
export function swatch(color: string, kind: "shapes" | "raster" = "shapes"): HTMLElement {
  const element = el("span", { class: `swatch of-${kind}`, aria: { hidden: "true" } });
  element.style.backgroundColor = color;
  return element;
}

/** What the colors of a grid mean. */
export function legend(entries: { label: string; color: string }[]): HTMLElement {
  return el(
    "ul",
    { class: "legend" },
    ...entries.map(({ label, color }) =>
      el("li", {}, swatch(color, "raster"), el("span", { text: label })),
    ),
  );
}
