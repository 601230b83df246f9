/** The evidence for an object on the map: observations, cameras, and fused outlines. */

import Feature from "ol/Feature.js";
import type OpenLayersMap from "ol/Map.js";
import MultiPolygon from "ol/geom/MultiPolygon.js";
import PointGeometry from "ol/geom/Point.js";
import { fromExtent } from "ol/geom/Polygon.js";
import VectorLayer from "ol/layer/Vector.js";
import VectorSource from "ol/source/Vector.js";
import { cameraLook, chosenSeenLook, outlineLook, seenLook, veilLook } from "./evidencelooks";
import { extentOf } from "./geometry";
import type { Evidence, Point, Polygon } from "./source";

/** The evidence that is shown on the map. */
export interface ShownEvidence {
  evidence: Evidence;
  inMap: Polygon[];
  /** The selected observation; null for all. */
  chosen: number | null;
  /** "seen", "cameras", "in_map", or a method. */
  hidden: ReadonlySet<string>;
}

/** Half the side of the veil [m]. */
const FAR = 1e7;

export class EvidenceLayer {
  private readonly layers = {
    veil: evidenceLayer(71),
    cameras: evidenceLayer(72),
    seen: evidenceLayer(73),
    outlines: evidenceLayer(74),
  };
  private shown: ShownEvidence | null = null;

  constructor(map: OpenLayersMap) {
    for (const layer of Object.values(this.layers)) map.addLayer(layer);
  }

  show(shown: ShownEvidence): void {
    this.shown = shown;
    const { evidence, inMap, chosen, hidden } = shown;
    const { observations, fused } = evidence;
    const isFaint = (i: number) => chosen !== null && i !== chosen;
    const veil = new Feature(fromExtent([-FAR, -FAR, FAR, FAR]));
    veil.setStyle(veilLook());

    const seen = observations.map((one, i) => {
      const feature = new Feature(new MultiPolygon(one.polygons));
      feature.setStyle(
        i === chosen
          ? chosenSeenLook(one.camera, middleOf(one.polygons))
          : seenLook(one, observations.length, isFaint(i)),
      );
      return feature;
    });
    const cameras = observations.map(({ camera, yaw }, i) => {
      const feature = new Feature(new PointGeometry(camera));
      feature.setStyle(cameraLook(yaw, i === chosen ? "chosen" : isFaint(i) ? "faint" : "plain"));
      return feature;
    });
    const outlines = [{ method: "in_map", polygons: inMap }, ...fused]
      .filter(({ method }) => !hidden.has(method))
      .map(({ method, polygons }) => {
        const feature = new Feature(new MultiPolygon(polygons));
        feature.setStyle(outlineLook(method));
        return feature;
      });
    // The selected one is on top.
    if (chosen !== null) seen.push(...seen.splice(chosen, 1));
    fill(this.layers.veil, [veil]);
    fill(this.layers.seen, hidden.has("seen") ? [] : seen);
    fill(this.layers.cameras, hidden.has("cameras") ? [] : cameras);
    fill(this.layers.outlines, outlines);
  }

  restyle(): void {
    if (this.shown) this.show(this.shown);
  }

  clear(): void {
    this.shown = null;
    for (const layer of Object.values(this.layers)) fill(layer, []);
  }
}

function evidenceLayer(zIndex: number): VectorLayer<VectorSource> {
  return new VectorLayer({ source: new VectorSource(), zIndex, updateWhileAnimating: true });
}

function fill(layer: VectorLayer<VectorSource>, features: Feature[]): void {
  layer.getSource()?.clear(true);
  layer.getSource()?.addFeatures(features);
}

function middleOf(polygons: Polygon[]): Point {
  const [x0, y0, x1, y1] = extentOf(polygons);
  return [(x0 + x1) / 2, (y0 + y1) / 2];
}
