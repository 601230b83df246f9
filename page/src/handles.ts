/** What can be dragged of the object being edited: corners, edges, the whole, and a handle that
 * turns it. */

import type Feature from "ol/Feature.js";
import type MultiPolygon from "ol/geom/MultiPolygon.js";
import type Interaction from "ol/interaction/Interaction.js";
import Modify from "ol/interaction/Modify.js";
import PointerInteraction from "ol/interaction/Pointer.js";
import Snap from "ol/interaction/Snap.js";
import type VectorLayer from "ol/layer/Vector.js";
import type OpenLayersMap from "ol/Map.js";
import type MapBrowserEvent from "ol/MapBrowserEvent.js";
import type VectorSource from "ol/source/Vector.js";
import { centroidOf, holds, toEdge } from "./geometry";
import { turnHandle } from "./looks";
import type { Point, Polygon } from "./source";

/** Distance from an edge within which a press drags it [pixels]. */
const NEAR = 12;
/** Of a small shape, only this share of a side counts as edge, so the whole can be dragged, too. */
const SHARE = 0.25;
/** With the shift key, a shape turns in steps of this size. */
const STEP = Math.PI / 12;

type Dragged = "Reshaped" | "Moved" | "Turned";

export class Handles {
  private readonly interactions: Interaction[];

  constructor(
    private readonly map: OpenLayersMap,
    private readonly layer: VectorLayer<VectorSource<Feature<MultiPolygon>>>,
    private readonly dragged: (how: Dragged) => void,
    private readonly isDrawing: () => boolean,
  ) {
    const source = layer.getSource() ?? undefined;
    const modify = new Modify({
      source,
      pixelTolerance: NEAR,
      condition: ({ coordinate }) => this.isNearEdge([coordinate[0], coordinate[1]]),
    });
    modify.on("modifyend", () => dragged("Reshaped"));
    // The last handler comes first.
    this.interactions = [
      this.moving(),
      modify,
      new Snap({ source, pixelTolerance: 8 }),
      this.turning(),
    ];
  }

  start(): void {
    for (const one of this.interactions) this.map.addInteraction(one);
  }

  stop(): void {
    for (const one of this.interactions) this.map.removeInteraction(one);
    for (const name of ["over-shape", "over-turn"]) this.lookAs(name, false);
  }

  /** What is edited; nothing while clicks draw something else, such as a line across it. */
  private get shape(): MultiPolygon | null {
    if (this.isDrawing()) return null;
    return this.layer.getSource()?.getFeatures()[0]?.getGeometry() ?? null;
  }

  private get resolution(): number {
    return this.map.getView().getResolution() ?? 1;
  }

  private isNearEdge(place: Point): boolean {
    if (!this.shape) return false;
    const [x0, y0, x1, y1] = this.shape.getExtent();
    const near = Math.min(NEAR * this.resolution, SHARE * Math.min(x1 - x0, y1 - y0));
    return toEdge(this.shape.getCoordinates() as Polygon[], place) <= near;
  }

  private moving(): Interaction {
    let [at, isMoved] = [[0, 0], false];
    const isOn = ({ coordinate: [x, y] }: MapBrowserEvent): boolean =>
      this.shape !== null && holds(this.shape.getCoordinates() as Polygon[], [x, y]);
    return new PointerInteraction({
      handleMoveEvent: (event) => this.lookAs("over-shape", isOn(event)),
      handleDownEvent: (event) => {
        [at, isMoved] = [event.coordinate, false];
        return isOn(event);
      },
      handleDragEvent: ({ coordinate }) => {
        this.shape?.translate(coordinate[0] - at[0], coordinate[1] - at[1]);
        [at, isMoved] = [coordinate, true];
      },
      handleUpEvent: () => {
        if (isMoved) this.dragged("Moved");
        return false;
      },
    });
  }

  private lookAs(name: string, on: boolean): void {
    this.map.getViewport()?.classList.toggle(name, on);
  }

  private turning(): Interaction {
    let [middle, from, turned]: [Point, number, number] = [[0, 0], 0, 0];
    const angle = ({ coordinate: [x, y] }: MapBrowserEvent) =>
      Math.atan2(y - middle[1], x - middle[0]);
    const isOn = ({ coordinate: [x, y] }: MapBrowserEvent): boolean => {
      if (!this.shape) return false;
      const [hx, hy] = turnHandle(this.shape, this.resolution);
      return Math.hypot(x - hx, y - hy) <= NEAR * this.resolution;
    };
    return new PointerInteraction({
      handleMoveEvent: (event) => this.lookAs("over-turn", isOn(event)),
      handleDownEvent: (event) => {
        if (!this.shape || !isOn(event)) return false;
        middle = centroidOf(this.shape.getCoordinates() as Polygon[]);
        [from, turned] = [angle(event), 0];
        return true;
      },
      handleDragEvent: (event) => {
        let wanted = angle(event) - from;
        if ((event.originalEvent as PointerEvent).shiftKey) {
          wanted = Math.round(wanted / STEP) * STEP;
        }
        this.shape?.rotate(wanted - turned, middle);
        turned = wanted;
      },
      handleUpEvent: () => {
        if (turned) this.dragged("Turned");
        return false;
      },
    });
  }
}
