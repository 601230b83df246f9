/** The map on the screen: its layers, marks and view. */

import Feature from "ol/Feature.js";
import OpenLayersMap from "ol/Map.js";
import type View from "ol/View.js";
import { easeOut } from "ol/easing.js";
import { boundingExtent } from "ol/extent.js";
import LineString from "ol/geom/LineString.js";
import MultiPolygon from "ol/geom/MultiPolygon.js";
import PointGeometry from "ol/geom/Point.js";
import { defaults as defaultInteractions } from "ol/interaction/defaults.js";
import type TileLayer from "ol/layer/Tile.js";
import type ImageTile from "ol/source/ImageTile.js";
import { EvidenceLayer, type ShownEvidence } from "./evidencelayer";
import { GridLines } from "./gridlines";
import {
  areaLook,
  changeLook,
  restLook,
  chosenLook,
  doorLook,
  matchLook,
  noteLook,
  pathLook,
  placeLook,
  ROOMS,
} from "./looks";
import type { Place } from "./place";
import {
  calm,
  featureLayer,
  fitView,
  planeView,
  setFeatures,
  type FeatureLayer,
  type Insets,
} from "./plane";
import type { Settings } from "./settings";
import { ShapesLayer } from "./shapeslayer";
import type {
  ChangeEnd,
  DataSource,
  Extent,
  Frame,
  LayerInfo,
  MapInfo,
  ObjectChange,
  Point,
  Polygon,
  Ring,
} from "./source";
import { FramesLayer } from "./frameslayer";
import { tileLayer, tileSource } from "./tiles";

export interface ShownLayer {
  info: LayerInfo;
  /** Of what is drawn. */
  version?: number;
  tiles?: TileLayer<ImageTile>;
  shapes?: ShapesLayer;
  notes?: FeatureLayer;
}

/** What automap has covered: unknown around it, so that it hides the grids below until it is asked for. */
const MAPPED = "mapped_grid";
const FINEST = 0.0001; // meters per pixel
/** How far from a panel a marked place should lie [pixels]. */
const EDGE = 30;
/** A part that fills this share of the view is large enough to see. */
const SEEN_WELL = 0.25;
/** Margin around a part that is shown, relative to its size. */
const MARGIN = 0.5;
/** Close enough to see what a place is [meters per pixel]. */
const CLOSE = 0.01;
/** Least time between two requests for shapes while the map moves [ms]. */
const PAUSE = 150;

export class MapView {
  readonly map: OpenLayersMap;
  readonly layers = new Map<string, ShownLayer>();
  readonly grid: GridLines;
  private readonly evidence: EvidenceLayer;
  readonly frames = new FramesLayer();
  private readonly doors = featureLayer(50);
  private readonly changes = featureLayer(78);
  private readonly marks = {
    rest: featureLayer(78),
    path: featureLayer(79),
    area: featureLayer(80),
    chosen: featureLayer(81),
    matches: featureLayer(82),
    place: featureLayer(83),
  };
  private readonly view: View;
  private timer = 0;
  private isFitting = false;
  /** What was fitted into the view, and that view. */
  private fitted: { extent: Extent; minResolution: number; view: string } | null = null;

  constructor(
    target: HTMLElement,
    private readonly source: DataSource,
    private readonly insets: () => Insets,
    private readonly shapesChanged: () => void,
  ) {
    this.view = planeView(FINEST);
    this.grid = new GridLines(() => {
      const { left, bottom } = insets();
      return { left: left + 8, bottom: bottom + 10 };
    });
    this.grid.setZIndex(60);
    this.frames.layer.setZIndex(70);
    this.map = new OpenLayersMap({
      target,
      view: this.view,
      controls: [],
      interactions: defaultInteractions({ altShiftDragRotate: false, pinchRotate: false }),
      layers: [
        this.doors,
        this.changes,
        this.grid,
        this.frames.layer,
        ...Object.values(this.marks),
      ],
      keyboardEventTarget: target,
    });
    this.evidence = new EvidenceLayer(this.map);
    this.view.on("change", () => this.later());
    this.map.on("change:size", () => this.later());
  }

  /** Updates to the current map; layers that did not change keep their content. */
  setInfo(info: MapInfo): void {
    const names = new Set(info.layers.map(({ name }) => name));
    for (const [name, shown] of this.layers) {
      if (names.has(name)) continue;
      const drawn = drawnLayer(shown);
      if (drawn) this.map.removeLayer(drawn);
      this.layers.delete(name);
    }
    info.layers.forEach((layer, order) => this.setLayer(layer, order, info));
    this.frames.setFrames(info.frames);
    const doors = (info.doors ?? []).map(({ line }) => new Feature(new LineString(line)));
    setFeatures(this.doors, doors);
    this.showDoors();
    this.later();
  }

  private setLayer(info: LayerInfo, order: number, map: MapInfo): void {
    const version = info.version ?? map.version;
    const shown = this.layers.get(info.name) ?? this.addLayer(info);
    const isRooms = info.name === ROOMS; // which hold all others, so they lie below them
    if (!shown.notes)
      drawnLayer(shown)?.setZIndex(isRooms ? 19 : order + (info.kind === "shapes" ? 20 : 0));
    shown.info = info;
    if (shown.version === version) return;
    shown.version = version;
    shown.shapes?.update(info, version, map.extent);
    shown.tiles?.setSource(tileSource(info, this.source, version));
  }

  private addLayer(info: LayerInfo): ShownLayer {
    const shown: ShownLayer = { info };
    if (info.kind === "raster") {
      shown.tiles = tileLayer();
      shown.tiles.setVisible(!isMeasured(info) || !this.hasMeasured());
      this.map.addLayer(shown.tiles);
    } else if (info.kind === "notes") {
      shown.notes = featureLayer(76);
      shown.notes.setStyle((feature) =>
        noteLook(feature.get("number") as number | null, feature.get("shown") === true),
      );
      this.map.addLayer(shown.notes);
    } else if (info.kind === "shapes") {
      shown.shapes = new ShapesLayer(info, this.source, this.shapesChanged);
      this.map.addLayer(shown.shapes.layer);
    }
    this.layers.set(info.name, shown);
    if (info.name === MAPPED) drawnLayer(shown)?.setVisible(false);
    if (info.name === ROOMS) drawnLayer(shown)?.on("change:visible", () => this.showDoors());
    return shown;
  }

  /** Of several quantities, the first is shown until another is chosen. */
  private hasMeasured(): boolean {
    return [...this.layers.values()].some(({ info }) => isMeasured(info));
  }

  /** Doors are visible while the rooms are. */
  private showDoors(): void {
    const rooms = this.layers.get(ROOMS);
    this.doors.setVisible(rooms !== undefined && isVisible(rooms));
  }

  /** Requests shapes soon; several calls become one. */
  later(): void {
    if (this.timer) return;
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      void this.showShapes();
    }, PAUSE);
  }

  async showShapes(): Promise<void> {
    const size = this.map.getSize();
    if (!size || !size[0] || !size[1]) return;
    const extent = this.view.calculateExtent(size) as Extent;
    const resolution = this.resolution;
    await Promise.all(
      [...this.layers.values()].map(({ shapes }) => shapes?.show(extent, resolution)),
    );
  }

  get resolution(): number {
    return this.view.getResolution() ?? 1;
  }

  /** The middle of what is not covered by panels. */
  get center(): Point {
    const { top, right, bottom, left } = this.insets();
    const [x, y] = this.view.getCenter() ?? [0, 0];
    const half = this.resolution / 2;
    return [x + (left - right) * half, y + (top - bottom) * -half];
  }

  setPlace({ center: [x, y], resolution }: Place): void {
    this.view.setResolution(resolution);
    this.view.setCenter([x, y]);
  }

  /** The place for a link: the view's own middle, whatever panels are open. */
  place(frame: string | null): Place {
    const [x, y] = this.view.getCenter() ?? [0, 0];
    const hidden = [...this.layers.values()]
      .filter((shown) => !isVisible(shown))
      .map(({ info }) => info.name);
    return { center: [x, y], resolution: this.resolution, frame, hidden };
  }

  fit(extent: Extent | null, animate = true, minResolution = 0.002): void {
    const shown = extent ?? ([-5, -5, 5, 5] as Extent);
    this.fitted = null;
    this.isFitting = true;
    fitView(this.view, shown, this.insets(), {
      margin: 24,
      minResolution,
      animate,
      callback: (isDone) => {
        this.isFitting = false;
        if (isDone) this.fitted = { extent: shown, minResolution, view: this.viewKey() };
      },
    });
  }

  /** After a panel opened or closed: what was fitted into the free part is fitted again,
   * unless the user has moved the map since. */
  makeRoom(): void {
    const { fitted } = this;
    if (fitted?.view === this.viewKey()) this.fit(fitted.extent, true, fitted.minResolution);
  }

  private viewKey(): string {
    return `${this.view.getCenter()?.join()} ${this.view.getResolution()}`;
  }

  /** Moves a place into the uncovered part; zooms in if it would be small. */
  flyTo([x, y]: Point, side: number): void {
    const { top, right, bottom, left } = this.insets();
    const resolution = Math.min(this.resolution, Math.max(side, 0.3) / 90);
    this.view.animate({
      center: [x + ((right - left) * resolution) / 2, y + ((top - bottom) * resolution) / 2],
      resolution,
      duration: calm() ? 0 : 450,
      easing: easeOut,
    });
  }

  /** Shows a part of the map; does not move if that part is visible and large enough. */
  frame([x0, y0, x1, y1]: Extent): void {
    const size = this.map.getSize();
    if (!size) return;
    const { top, right, bottom, left } = this.insets();
    const [width, height] = [size[0] - left - right, size[1] - top - bottom];
    const [column0, row0] = this.map.getPixelFromCoordinate([x0, y1]) ?? [-1, -1];
    const [column1, row1] = this.map.getPixelFromCoordinate([x1, y0]) ?? [-1, -1];
    const isInView =
      column0 >= left && column1 <= left + width && row0 >= top && row1 <= top + height;
    const share = Math.max((column1 - column0) / width, (row1 - row0) / height);
    if (isInView && share > SEEN_WELL) return;
    const [dx, dy] = [(x1 - x0) * MARGIN, (y1 - y0) * MARGIN];
    this.fit([x0 - dx, y0 - dy, x1 + dx, y1 + dy]);
  }

  /** Brings places into view if none of them is, without zooming in. */
  showAny(places: Point[]): void {
    const size = this.map.getSize();
    if (!size || !places.length) return;
    const { top, right, bottom, left } = this.insets();
    const isInView = ([column, row]: number[]) =>
      column > left && column < size[0] - right && row > top && row < size[1] - bottom;
    if (places.some((place) => isInView(this.map.getPixelFromCoordinate(place) ?? [-1, -1]))) {
      return;
    }
    const closest = Math.max(this.resolution, CLOSE);
    this.fit(boundingExtent(places) as Extent, true, closest);
  }

  /** Moves the map a little if a place would be under a panel; not while it moves anyway. */
  reveal(place: Point): void {
    if (this.isFitting) return;
    const pixel = this.map.getPixelFromCoordinate(place);
    const size = this.map.getSize();
    if (!pixel || !size) return;
    const { top, right, bottom, left } = this.insets();
    const into = (at: number, low: number, high: number) =>
      at < low ? low - at : at > high ? high - at : 0;
    const dx = into(pixel[0], left + EDGE, size[0] - right - EDGE);
    const dy = into(pixel[1], top + EDGE, size[1] - bottom - EDGE);
    if (!dx && !dy) return;
    const [x, y] = this.view.getCenter() ?? [0, 0];
    const center = [x - dx * this.resolution, y + dy * this.resolution];
    this.view.animate({ center, duration: calm() ? 0 : 300, easing: easeOut });
  }

  /** Whether a layer is there and visible. */
  isShown(name: string): boolean {
    const shown = this.layers.get(name);
    return shown !== undefined && isVisible(shown);
  }

  restyle(settings: Settings): void {
    for (const { notes } of this.layers.values()) notes?.changed();
    for (const { shapes } of this.layers.values()) {
      shapes?.restyle(settings.labels ? settings.labelSize : null);
    }
    this.grid.setVisible(settings.grid);
    this.grid.changed();
    this.frames.layer.setVisible(settings.frames);
    this.frames.restyle();
    this.evidence.restyle();
    this.doors.setStyle(doorLook());
    this.changes.setStyle(changeLook);
    this.marks.path.setStyle(pathLook());
    this.marks.place.setStyle(placeLook());
    this.marks.area.setStyle(areaLook());
    this.marks.rest.setStyle(restLook());
    this.marks.chosen.setStyle(chosenLook());
    this.marks.matches.setStyle((feature) =>
      matchLook(feature.get("rank") as number, feature.get("looked") === true),
    );
  }

  setFrame(frame: Frame): void {
    this.grid.frame = frame;
    this.grid.changed();
  }

  /** Marks what changed: shapes before and after, and arrows; colors are by kind of change. */
  markChanges(changes: ObjectChange[], colors: Record<string, string>): void {
    const features = changes.flatMap(({ kind, before, after }) => {
      const color = colors[kind] ?? "#808080";
      const shape = (end: ChangeEnd, part: string) => {
        const feature = new Feature(new MultiPolygon(end.polygons));
        feature.setProperties({ color, part });
        return feature;
      };
      const found = [];
      if (before) found.push(shape(before, "before"));
      if (after) found.push(shape(after, "after"));
      if (before && after && kind === "moved") {
        const arrow = new Feature(new LineString([before.at, after.at]));
        arrow.setProperties({ color, part: "arrow" });
        found.push(arrow);
      }
      return found;
    });
    setFeatures(this.changes, features);
  }

  markPlace(point: Point | null): void {
    setFeatures(this.marks.place, point ? [new Feature(new PointGeometry(point))] : []);
  }

  markPath(points: Point[] | null): void {
    setFeatures(this.marks.path, points ? [new Feature(new LineString(points))] : []);
  }

  markArea(ring: Ring | null): void {
    setFeatures(this.marks.area, ring ? [new Feature(new MultiPolygon([[ring]]))] : []);
  }

  /** What of an area is not covered. */
  markRest(polygons: Polygon[]): void {
    setFeatures(this.marks.rest, [new Feature(new MultiPolygon(polygons))]);
  }

  markChosen(polygons: Polygon[] | null): void {
    setFeatures(this.marks.chosen, polygons ? [new Feature(new MultiPolygon(polygons))] : []);
  }

  markMatches(points: Point[]): void {
    const features = points.map((point, i) => {
      const feature = new Feature(new PointGeometry(point));
      feature.set("rank", i + 1);
      return feature;
    });
    setFeatures(this.marks.matches, features);
  }

  /** Highlights a match, by its rank in the list, and brings it into the free part. */
  lookAtMatch(rank: number | null): void {
    for (const feature of this.marks.matches.getSource()?.getFeatures() ?? []) {
      const isLookedAt = feature.get("rank") === (rank ?? -1) + 1;
      feature.set("looked", isLookedAt);
      const at = (feature.getGeometry() as PointGeometry).getCoordinates();
      if (isLookedAt) this.reveal([at[0], at[1]]);
    }
  }

  /** Draws the evidence for an object, and dims the rest of the map; null for nothing. */
  showEvidence(shown: ShownEvidence | null): void {
    if (shown) this.evidence.show(shown);
    else this.evidence.clear();
    this.marks.place.setVisible(shown === null);
  }

  clearMarks(): void {
    for (const layer of Object.values(this.marks)) setFeatures(layer, []);
  }
}

export function isMeasured({ class_name }: LayerInfo): boolean {
  return class_name === "ValueLayer";
}

/** The OpenLayers layer of a map layer; none if it cannot be drawn. */
export function drawnLayer({ tiles, shapes, notes }: ShownLayer): DrawnLayer | undefined {
  return tiles ?? shapes?.layer ?? notes;
}

export type DrawnLayer = TileLayer<ImageTile> | ShapesLayer["layer"] | FeatureLayer;

export function isVisible(shown: ShownLayer): boolean {
  return drawnLayer(shown)?.getVisible() ?? true;
}
