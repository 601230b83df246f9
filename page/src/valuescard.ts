/** The card of measured values: which quantity is shown, its colors, and the value at the pointer. */

import Feature from "ol/Feature.js";
import LineString from "ol/geom/LineString.js";
import { contoursAt, levelsBetween, thinned } from "./contours";
import { byId, complain, el } from "./dom";
import { contourLook } from "./looks";
import { drawnLayer, isMeasured, isVisible, type MapView, type ShownLayer } from "./mapview";
import { featureLayer, setFeatures } from "./plane";
import type { DataSource, Point } from "./source";
import { MeasuredValues } from "./values";

/** Below objects and above grids. */
const CONTOURS_Z = 18;
/** Lines are drawn of so many cells at most; of a finer grid, every second or third of a row. */
const MOST_CELLS = 1_000_000;

export class ValuesCard {
  private readonly contours = featureLayer(CONTOURS_Z, { declutter: true });
  private readonly select = el("select", { aria: { label: "Measured quantity" } });
  private readonly output = el("output", { aria: { label: "Value under the pointer" } });
  private readonly colors = el("div", { class: "colors of-raster", aria: { hidden: "true" } });
  private readonly ticks = el("div", { class: "ticks quiet" });
  private readonly paler = el("span", { class: "quiet", text: "Paler: less certain" });
  private readonly today = el("span", { class: "quiet of-today", text: "As of now" });
  private readonly lines = el("input", { type: "checkbox" });
  private pointer: Point | null = null;
  private isPast = false;
  private shown: { layer: string; version: number; values: MeasuredValues | null } | null = null;

  constructor(
    private readonly view: MapView,
    private readonly source: DataSource,
    private readonly changed: () => void,
  ) {
    view.map.addLayer(this.contours);
    this.select.onchange = () => this.choose(this.select.value);
    this.lines.onchange = () => this.drawContours();
    this.today.hidden = true;
    byId("values").append(
      el("div", { class: "values-head" }, this.select, this.output),
      this.colors,
      this.ticks,
      el(
        "div",
        { class: "values-foot" },
        el("label", { class: "check" }, this.lines, el("span", { text: "Contours" })),
        this.today,
        this.paler,
      ),
    );
  }

  /** Follows the map, and which layers are visible. */
  draw(): void {
    const layers = this.layers();
    byId("values").hidden = layers.length === 0;
    const top = layers.filter(isVisible).pop();
    const options = layers.map(({ info }) => el("option", { value: info.name, text: info.name }));
    this.select.replaceChildren(...options, el("option", { value: "", text: "No values" }));
    this.select.value = top?.info.name ?? "";
    void this.show(top ?? null).catch(complain);
  }

  /** Where the map is shown as it was, values that are not are said to be those of now. */
  setPast(isPast: boolean): void {
    this.isPast = isPast;
  }

  setPointer(point: Point | null): void {
    this.pointer = point;
    this.write();
  }

  /** Draws the lines in the colors of the theme. */
  restyle(): void {
    for (const feature of this.contours.getSource()?.getFeatures() ?? []) {
      feature.setStyle(contourLook(feature.get("text") as string));
    }
  }

  private layers(): ShownLayer[] {
    return [...this.view.layers.values()].filter(({ info, tiles }) => isMeasured(info) && tiles);
  }

  private choose(name: string): void {
    for (const layer of this.layers()) drawnLayer(layer)?.setVisible(layer.info.name === name);
    this.changed();
  }

  private async show(layer: ShownLayer | null): Promise<void> {
    this.showColors(layer);
    const [name, version] = [layer?.info.name ?? "", layer?.version ?? 0];
    if (this.shown?.layer !== name || this.shown.version !== version) {
      const asked = { layer: name, version, values: null as MeasuredValues | null };
      this.shown = asked;
      this.drawContours();
      if (!layer) return this.write();
      const sent = await this.source.values(name, version);
      asked.values = new MeasuredValues(sent);
      if (this.shown !== asked) return;
      this.drawContours();
    }
    this.write();
  }

  private showColors(layer: ShownLayer | null): void {
    const legend = (layer?.info.legend ?? []).filter(({ label }) => !label.startsWith("paler"));
    const stops = legend.map(({ color }) => color).reverse();
    this.colors.style.background =
      stops.length > 1 ? `linear-gradient(to right, ${stops.join(", ")})` : (stops[0] ?? "none");
    const labels = legend.map(({ label }) => label).reverse();
    const middle = labels.length > 2 ? [labels[Math.floor(labels.length / 2)]] : [];
    const ends = labels.length > 1 ? [labels[0], ...middle, labels[labels.length - 1]] : labels;
    this.ticks.replaceChildren(...ends.map((text) => el("span", { text })));
    this.paler.hidden = legend.length === (layer?.info.legend.length ?? 0);
    this.today.hidden = !this.isPast || !layer || layer.info.as_it_was === true;
    for (const part of [this.colors, this.ticks, this.output]) part.hidden = layer === null;
    this.lines.disabled = layer === null;
  }

  private write(): void {
    const values = this.shown?.values;
    this.output.textContent = values && this.pointer ? values.text(values.at(this.pointer)) : "–";
  }

  private drawContours(): void {
    const values = this.shown?.values;
    const range = values?.range;
    if (!this.lines.checked || !values || !range) return setFeatures(this.contours, []);
    const grid = thinned(values.values, values.width, values.height, MOST_CELLS);
    const place = (inCells: number) => (inCells - 0.5) * grid.every + 0.5;
    const features = levelsBetween(...range).flatMap((level) =>
      contoursAt(grid.values, grid.width, grid.height, level).map(({ points }) => {
        const line = points.map(([column, row]) => values.toBase([place(column), place(row)]));
        const feature = new Feature(new LineString(line));
        feature.set("text", `${level} ${values.unit}`.trimEnd());
        return feature;
      }),
    );
    setFeatures(this.contours, features);
    this.restyle();
  }
}
