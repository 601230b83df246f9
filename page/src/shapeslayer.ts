/** A layer of objects on the map: requests what is in view, and draws it. */

import Feature from "ol/Feature.js";
import { buffer, containsExtent, getHeight, getWidth } from "ol/extent.js";
import MultiPolygon from "ol/geom/MultiPolygon.js";
import PointGeometry from "ol/geom/Point.js";
import VectorImageLayer from "ol/layer/VectorImage.js";
import VectorSource from "ol/source/Vector.js";
import type Style from "ol/style/Style.js";
import { complain } from "./dom";
import { classLook, ROOMS, type ClassLook } from "./looks";
import { NameSides } from "./namesides";
import type {
  ClassInfo,
  DataSource,
  Extent,
  LayerInfo,
  Point,
  Ring,
  Shape,
  Shapes,
} from "./source";

/** The request that the drawn shapes answer. */
interface Loaded {
  extent: Extent;
  resolution: number;
  key: string;
  whole: boolean;
}

/** With fewer objects, all have names; with more, only those large enough on the screen. */
const FEW = 150;
const LARGE_ENOUGH = 9;
/** Size of the picture of the shapes, relative to the view. */
const PICTURE = 1.4;
/** Side of the square that represents smaller objects [pixels]. */
const DOT = 3;
/** With more names than this, a request asks for all. */
const MOST_NAMES = 200;

export class ShapesLayer {
  readonly layer: VectorImageLayer<VectorSource>;
  /** Names of the classes that are switched off. */
  readonly hidden = new Set<string>();
  shown = 0;
  total = 0;
  private labelSize: number | null = null;
  private readonly looks = new Map<string, ClassLook>();
  private loaded: Loaded | null = null;
  private asking: AbortController | null = null;
  private version = 0;
  private bounds: Extent | null = null;
  private readonly sides = new NameSides({
    features: (resolution) => this.named(resolution),
    sizeOf: (feature) => this.classLook(feature.get("name") as string).size ?? [0, 0],
    bounds: () => this.bounds,
  });

  constructor(
    private info: LayerInfo,
    private readonly source: DataSource,
    private readonly changed: () => void,
  ) {
    // Drawn once as a picture that moves with the map: redrawing many shapes per frame stutters.
    this.layer = new VectorImageLayer({
      // Neighbors of one style may be drawn in one stroke.
      source: new VectorSource({ overlaps: false }),
      declutter: true,
      imageRatio: PICTURE,
      style: (feature, resolution) => this.lookOf(feature as Feature, resolution),
    });
  }

  /** @param bounds - of the whole map. */
  update(info: LayerInfo, version: number, bounds: Extent | null): void {
    this.info = info;
    this.bounds = bounds;
    this.version = version;
    this.looks.clear();
    this.sides.forget();
  }

  restyle(labelSize: number | null): void {
    this.labelSize = labelSize;
    this.looks.clear();
    this.sides.forget();
    this.layer.changed();
  }

  setHidden(names: string[], hidden: boolean): void {
    for (const name of names) {
      if (hidden) this.hidden.add(name);
      else this.hidden.delete(name);
    }
    this.sides.forget();
    this.layer.changed();
  }

  /** Requests the objects of an extent, unless they are drawn already. */
  async show(view: Extent, resolution: number): Promise<void> {
    if (!this.layer.getVisible()) return;
    const names = this.names();
    const key = `${this.version} ${names?.join("\n") ?? "*"}`;
    if (this.isLoaded(view, resolution, key)) return;
    const margin = 0.2 * Math.max(getWidth(view), getHeight(view));
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
      this.draw(shapes, resolution);
      this.loaded = { extent, resolution, key, whole: shapes.shown >= shapes.total };
      this.changed();
    } catch (error) {
      if (!asking.signal.aborted) complain(error);
    }
  }

  /** The visible classes of the objects in an extent. */
  classesIn(extent: Extent): ClassInfo[] {
    const features = this.layer.getSource()?.getFeaturesInExtent(extent) ?? [];
    const names = new Set(features.map((feature) => feature.get("name") as string));
    return this.info.classes.filter(({ name }) => names.has(name) && !this.hidden.has(name));
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

  private draw({ features, shown, total }: Shapes, resolution: number): void {
    this.shown = shown;
    this.total = total;
    this.sides.forget();
    const source = this.layer.getSource();
    source?.clear(true);
    source?.addFeatures(inDrawingOrder(features).map((shape) => featureOf(shape, resolution)));
  }

  private lookOf(feature: Feature, resolution: number): Style[] | undefined {
    const name = feature.get("name") as string;
    if (this.hidden.has(name)) return undefined;
    const { shape, labels } = this.classLook(name);
    const side = labels && this.sides.of(feature, resolution);
    return labels && side ? [shape, labels[side]] : [shape];
  }

  private named(resolution: number): Feature[] {
    const isLarge = (feature: Feature) =>
      (feature.get("side") as number) / resolution > LARGE_ENOUGH;
    const features = this.layer.getSource()?.getFeatures() ?? [];
    return features.filter(
      (feature) =>
        !this.hidden.has(feature.get("name") as string) && (this.shown <= FEW || isLarge(feature)),
    );
  }

  private classLook(name: string): ClassLook {
    let look = this.looks.get(name);
    if (!look) {
      const color = this.info.classes.find((one) => one.name === name)?.color ?? "#808080";
      look = classLook(name, color, this.labelSize, this.info.name === ROOMS);
      this.looks.set(name, look);
    }
    return look;
  }
}

/** Large objects below small ones; if many, those of similar size by class, which is faster. */
function inDrawingOrder(shapes: Shape[]): Shape[] {
  const octave = ({ area }: Shape) => Math.floor(Math.log2(Math.max(area, 1e-6)) / 2);
  const size = shapes.length <= FEW ? ({ area }: Shape) => area : octave;
  return [...shapes].sort(
    (a, b) => size(b) - size(a) || (a.name < b.name ? -1 : +(a.name > b.name)),
  );
}

function featureOf({ id, name, polygons, point, at, area }: Shape, resolution: number): Feature {
  const rings = polygons?.length ? polygons : [[dot(point ?? at, DOT * resolution)]];
  const feature = new Feature({ geometry: new MultiPolygon(rings) });
  feature.setId(id);
  feature.setProperties({ name, at: new PointGeometry(at), side: Math.sqrt(area) }, true);
  return feature;
}

function dot([x, y]: Point, side: number): Ring {
  const [x0, y0] = [x - side / 2, y - side / 2];
  return [
    [x0, y0],
    [x0 + side, y0],
    [x0 + side, y0 + side],
    [x0, y0 + side],
  ];
}
