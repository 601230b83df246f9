/** Drawing a rectangle, polygon or line on the map. */

import type { Coordinate } from "ol/coordinate.js";
import type LineString from "ol/geom/LineString.js";
import type PolygonGeometry from "ol/geom/Polygon.js";
import Draw, { createBox } from "ol/interaction/Draw.js";
import type OpenLayersMap from "ol/Map.js";
import CircleStyle from "ol/style/Circle.js";
import Fill from "ol/style/Fill.js";
import Style from "ol/style/Style.js";
import { areaLook } from "./looks";
import { cssColor } from "./settings";
import type { Point, Ring } from "./source";

export type Kind = "rectangle" | "polygon" | "line";

const TYPES = { rectangle: "Circle", polygon: "Polygon", line: "LineString" } as const;

/** The longest double click; until then, it must not zoom the map [ms]. */
const DOUBLE_CLICK = 300;

export class Drawing {
  private draw: Draw | null = null;

  constructor(private readonly map: OpenLayersMap) {}

  get active(): boolean {
    return this.draw !== null;
  }

  /**
   * Lets the person draw one shape. The corners are those of a ring that is not closed, or both
   * ends of a line.
   */
  start(kind: Kind, done: (corners: Ring) => void): void {
    this.stop();
    const corner = new Style({
      image: new CircleStyle({ radius: 5, fill: new Fill({ color: cssColor("--accent") }) }),
    });
    const draw = new Draw({
      type: TYPES[kind],
      maxPoints: kind === "line" ? 2 : undefined,
      geometryFunction: kind === "rectangle" ? createBox() : undefined,
      freehand: kind === "rectangle",
      stopClick: true,
      style: [...areaLook(), corner],
    });
    draw.on("drawend", ({ feature }) => {
      const drawn = feature.getGeometry() as PolygonGeometry | LineString;
      const corners = cornersOf(drawn).map(([x, y]): Point => [x, y]);
      window.setTimeout(() => {
        if (this.draw === draw) this.stop();
      }, DOUBLE_CLICK);
      if (draw.get("spent")) return;
      draw.set("spent", true);
      if (kind === "line" ? hasNoLength(corners) : isFlat(corners)) {
        window.setTimeout(() => this.start(kind, done), DOUBLE_CLICK + 1);
      } else {
        done(corners);
      }
    });
    this.draw = draw;
    this.map.addInteraction(draw);
    this.map.getTargetElement()?.classList.add("drawing");
  }

  /** Completes a polygon with its current corners. */
  finish(): void {
    this.draw?.finishDrawing();
  }

  /** Removes the last corner. */
  back(): void {
    this.draw?.removeLastPoint();
  }

  stop(): void {
    if (!this.draw) return;
    this.map.removeInteraction(this.draw);
    this.draw = null;
    this.map.getTargetElement()?.classList.remove("drawing");
  }
}

function cornersOf(drawn: PolygonGeometry | LineString): Coordinate[] {
  const coordinates = drawn.getCoordinates();
  return isLine(coordinates) ? coordinates : coordinates[0].slice(0, -1);
}

function isLine(coordinates: Coordinate[] | Coordinate[][]): coordinates is Coordinate[] {
  return typeof coordinates[0]?.[0] === "number";
}

const hasNoLength = ([[x0, y0], [x1, y1]]: Ring): boolean => x0 === x1 && y0 === y1;

/** Whether a ring encloses nothing, as after a click without a drag. */
function isFlat(ring: Ring): boolean {
  const xs = ring.map(([x]) => x);
  const ys = ring.map(([, y]) => y);
  const [width, height] = [Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys)];
  return ring.length < 3 || width === 0 || height === 0;
}
