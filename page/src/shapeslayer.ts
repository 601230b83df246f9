/** A layer of objects on the map: asks for what the view shows, and draws it. */

import Feature from "ol/Feature.js";
import { buffer, containsExtent, getHeight, getWidth } from "ol/extent.js";
import MultiPolygon from "ol/geom/MultiPolygon.js";
import PointGeometry from "ol/geom/Point.js";
import VectorLayer from "ol/layer/Vector.js";
import VectorSource from "ol/source/Vector.js";
import type Style from "ol/style/Style.js";
import { complain } from "./dom";
import { classLook, type ClassLook } from "./looks";
import type { DataSource, Extent, LayerInfo, Shape, Shapes } from "./source";

/** What the drawn shapes were asked for. */
interface Loaded {
  extent: Extent;
  resolution: number;
  key: string;
  whole: boolean;
}

/** Below so many objects every one is named; above, only what is large enough on the screen. */
const FEW = 150;
const LARGE_ENOUGH = 9;
/** More names are not sent with a question; then all are asked for. */
const MOST_NAMES = 200;

export class ShapesLayer {
  readonly layer: VectorLayer<VectorSource>;
  /** Names of the classes that are switched off. */
  readonly hidden = new Set<string>();
  shown = 0;
  total = 0;
  private labelSize: number | null = null;
  private readonly looks = new Map<string, ClassLook>();
  private loaded: Loaded | null = null;
  private asking: AbortController | null = null;
  private version = 0;

  constructor(
    private info: LayerInfo,
    private readonly source: DataSource,
    private readonly changed: () => void,
  ) {
    this.layer = new VectorLayer({
      source: new VectorSource(),
      declutter: true,
      updateWhileAnimating: false,
      style: (feature, resolution) => this.lookOf(feature as Feature, resolution),
    });
  }

  update(info: LayerInfo, version: number): void {
    this.info = info;
    this.version = version;
    this.looks.clear();
  }

  restyle(labelSize: number | null): void {
    this.labelSize = labelSize;
    this.looks.clear();
    this.layer.changed();
  }

  setHidden(names: string[], hidden: boolean): void {
    for (const name of names) {
      if (hidden) this.hidden.add(name);
      else this.hidden.delete(name);
    }
    this.layer.changed();
  }

  /** Asks for what an extent shows, if that is not what is drawn already. */
  async show(view: Extent, resolution: number): Promise<void> {
    if (!this.layer.getVisible()) return;
    const names = this.names();
    const key = `${this.version} ${names?.join("\n") ?? "*"}`;
    if (this.isLoaded(view, resolution, key)) return;
    const margin = 0.3 * Math.max(getWidth(view), getHeight(view));
    const extent = buffer(view, margin) as Extent;
    this.asking?.abort();
    const asking = new AbortController();
    this.asking = asking;
    try {
      const { name } = this.info;
      const shapes =
        names?.length === 0
          ? { total: 0, shown: 0, features: [] }
          : await this.source.shapes(name, extent, resolution, names, this.version, asking.signal);
      if (asking.signal.aborted) return;
      this.draw(shapes);
      this.loaded = { extent, resolution, key, whole: shapes.shown >= shapes.total };
      this.changed();
    } catch (error) {
      if (!asking.signal.aborted) complain(error);
    }
  }

  private isLoaded(view: Extent, resolution: number, key: string): boolean {
    if (this.loaded?.key !== key || !containsExtent(this.loaded.extent, view)) return false;
    const ratio = resolution / this.loaded.resolution;
    return ratio > 0.6 && ratio < (this.loaded.whole ? 4 : 1.6);
  }

  /** The classes to ask for; null for all. */
  private names(): string[] | null {
    if (this.hidden.size === 0) return null;
    const names = this.info.classes
      .map(({ name }) => name)
      .filter((name) => !this.hidden.has(name));
    return names.length > MOST_NAMES ? null : names;
  }

  private draw({ features, shown, total }: Shapes): void {
    this.shown = shown;
    this.total = total;
    const source = this.layer.getSource();
    source?.clear(true);
    source?.addFeatures(features.map(featureOf));
  }

  private lookOf(feature: Feature, resolution: number): Style[] | undefined {
    const name = feature.get("name") as string;
    if (this.hidden.has(name)) return undefined;
    let look = this.looks.get(name);
    if (!look) {
      const color = this.info.classes.find((one) => one.name === name)?.color ?? "#808080";
      look = classLook(name, color, this.labelSize);
      this.looks.set(name, look);
    }
    const { shape, label } = look;
    if (!label) return [shape];
    const named = this.shown <= FEW || (feature.get("side") as number) / resolution > LARGE_ENOUGH;
    return named ? [shape, label] : [shape];
  }
}

function featureOf({ id, name, polygons, point, at, area }: Shape): Feature {
  const geometry = polygons?.length ? new MultiPolygon(polygons) : new PointGeometry(point ?? at);
  const feature = new Feature({ geometry });
  feature.setId(id);
  feature.setProperties({ name, at: new PointGeometry(at), side: Math.sqrt(area) }, true);
  return feature;
}
