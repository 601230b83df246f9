/** The map as it was at a step: grid, objects, what the frame saw, and the camera path. */

import Feature from "ol/Feature.js";
import OpenLayersMap from "ol/Map.js";
import type View from "ol/View.js";
import { createEmpty, extend, isEmpty } from "ol/extent.js";
import LineString from "ol/geom/LineString.js";
import MultiPolygon from "ol/geom/MultiPolygon.js";
import PointGeometry from "ol/geom/Point.js";
import { defaults as defaultInteractions } from "ol/interaction/defaults.js";
import { classLook, type ClassLook } from "../looks";
import { NameSides } from "../namesides";
import { featureLayer, fitView, planeView, setFeatures, type Insets } from "../plane";
import type { Extent, Point, Polygon } from "../source";
import { GridLayer } from "./gridlayer";
import { cameraLook, footprintLook, observedLook, wayLook } from "./runlooks";
import type { Observation, ObjectState, ObjectStates } from "./steps";

const FINEST = 0.0005; // meters per pixel
const LABEL = 13; // pixels
const MARGIN = 28; // pixels

export class RunMap {
  readonly map: OpenLayersMap;
  /** Until the user moves it, the view follows the known area. */
  follows = true;
  private readonly view: View;
  private readonly grid = new GridLayer();
  private readonly observed = layer(10);
  private readonly objects = layer(20);
  private readonly way = layer(30);
  private readonly footprints = layer(40);
  private readonly camera = layer(50);
  private readonly labels = layer(60, true);
  private colors: Record<string, string> = {};
  private readonly looks = new Map<string, ClassLook>();
  private extent: Extent | null = null;
  private readonly sides = new NameSides({
    features: () => this.labels.getSource()?.getFeatures() ?? [],
    sizeOf: (feature) => this.lookOf(feature).size ?? [0, 0],
    bounds: () => this.extent,
  });

  constructor(
    target: HTMLElement,
    private readonly insets: () => Insets,
  ) {
    this.view = planeView(FINEST);
    this.map = new OpenLayersMap({
      target,
      view: this.view,
      controls: [],
      // The arrow keys step through the run.
      interactions: defaultInteractions({
        altShiftDragRotate: false,
        pinchRotate: false,
        keyboard: false,
      }),
      layers: [
        this.grid,
        this.observed,
        this.objects,
        this.way,
        this.footprints,
        this.camera,
        this.labels,
      ],
    });
    const taken = () => (this.follows = false);
    target.addEventListener("wheel", taken, { passive: true });
    this.map.on("pointerdrag", taken);
    this.objects.setStyle((feature) => this.lookOf(feature as Feature).shape);
    this.labels.setStyle((feature, resolution) => {
      const side = this.sides.of(feature as Feature, resolution);
      return side ? this.lookOf(feature as Feature).labels?.[side] : undefined;
    });
    this.map.on("change:size", () => this.follow(false));
  }

  setColors(colors: Record<string, string>): void {
    this.colors = colors;
    this.renewLooks();
  }

  restyle(): void {
    this.renewLooks();
    this.observed.setStyle(observedLook());
    this.way.setStyle((feature) => wayLook(feature.get("ahead") as boolean));
    this.footprints.setStyle((feature) => footprintLook(feature.get("color") as string));
    this.camera.setStyle((feature) =>
      cameraLook(feature.get("yaw") as number | null, feature.get("width") as number),
    );
  }

  showGrid(picture: HTMLImageElement, extent: Extent): void {
    this.grid.show(picture, extent);
  }

  /** Shows a step: what its frame saw, the objects, and the camera path up to it. */
  show(observation: Observation, things: ObjectStates, places: Point[], position: number): void {
    setFeatures(this.observed, [shape(observation.observed)]);
    const objects = [...things.values()].sort((a, b) => areaOf(b) - areaOf(a)).map(featureOf);
    setFeatures(this.objects, objects);
    setFeatures(this.labels, objects);
    this.sides.forget();
    setFeatures(this.way, [
      way(places.slice(position), true),
      way(places.slice(0, position + 1), false),
    ]);
    setFeatures(
      this.footprints,
      observation.detections
        .filter(({ footprint }) => footprint.length)
        .map(({ footprint, name }) => shape(footprint, { color: this.colors[name] ?? "#808080" })),
    );
    const { x, y, yaw, width } = observation.camera;
    const eye = new Feature(new PointGeometry([x, y]));
    eye.setProperties({ yaw, width });
    setFeatures(this.camera, [eye]);
    this.setExtent(observation, things);
  }

  fit(animate = true): void {
    fitView(this.view, this.extent ?? [-3, -3, 3, 3], this.insets(), { margin: MARGIN, animate });
  }

  get resolution(): number {
    return this.view.getResolution() ?? 1;
  }

  private renewLooks(): void {
    this.looks.clear();
    this.sides.forget();
    this.objects.changed();
    this.labels.changed();
  }

  private setExtent(observation: Observation, things: ObjectStates): void {
    const known = createEmpty();
    if (observation.grid) extend(known, observation.grid.extent);
    for (const { polygons } of things.values())
      extend(known, new MultiPolygon(polygons).getExtent());
    const { x, y } = observation.camera;
    extend(known, [x, y, x, y]);
    if (isEmpty(known)) extend(known, [x - 1, y - 1, x + 1, y + 1]);
    const isFirst = this.extent === null;
    const before = this.extent?.join();
    this.extent = known as Extent;
    if (before !== this.extent.join()) this.follow(!isFirst);
  }

  private follow(animate: boolean): void {
    if (this.follows) this.fit(animate);
  }

  private lookOf(feature: Feature): ClassLook {
    const name = feature.get("name") as string;
    let look = this.looks.get(name);
    if (!look) {
      look = classLook(name, this.colors[name] ?? "#808080", LABEL);
      this.looks.set(name, look);
    }
    return look;
  }
}

const layer = (zIndex: number, declutter = false) =>
  featureLayer(zIndex, { declutter, updateWhileInteracting: true });

function shape(polygons: Polygon[], properties: Record<string, unknown> = {}): Feature {
  const feature = new Feature(new MultiPolygon(polygons));
  feature.setProperties(properties);
  return feature;
}

function way(places: Point[], ahead: boolean): Feature {
  const feature = new Feature(new LineString(places));
  feature.set("ahead", ahead);
  return feature;
}

function featureOf(thing: ObjectState): Feature {
  const geometry = new MultiPolygon(thing.polygons);
  const feature = new Feature(geometry);
  const middle = geometry.getInteriorPoints().getFirstCoordinate() ?? [0, 0];
  feature.setProperties({ name: thing.name, at: new PointGeometry(middle.slice(0, 2)), thing });
  return feature;
}

const areaOf = ({ polygons }: ObjectState): number => new MultiPolygon(polygons).getArea();
