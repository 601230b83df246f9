/** The side of its shape on which each name is placed, computed once per scale. */

import type Feature from "ol/Feature.js";
import type PointGeometry from "ol/geom/Point.js";
import { placeLabels, type Box, type Side } from "./labels";
import type { Extent } from "./source";

export interface Naming {
  /** Features that have names at a resolution [meters per pixel]. */
  features: (resolution: number) => Feature[];
  /** Size of a feature's name [pixels]. */
  sizeOf: (feature: Feature) => [number, number];
  /** Names are preferably placed inside it: the visible part. */
  bounds: () => Extent | null;
}

export class NameSides {
  private known: { resolution: number; sides: Map<Feature, Side | null> } | null = null;

  constructor(private readonly naming: Naming) {}

  /** Call when features or names have changed. */
  forget(): void {
    this.known = null;
  }

  /** The side of a feature's name; null if it has none, or there is no room. */
  of(feature: Feature, resolution: number): Side | null {
    if (this.known?.resolution !== resolution) {
      this.known = { resolution, sides: this.place(resolution) };
    }
    return this.known.sides.get(feature) ?? null;
  }

  private place(resolution: number): Map<Feature, Side | null> {
    const features = this.naming.features(resolution);
    const pixels = (values: number[]) => values.map((value) => value / resolution);
    const meters = (values: number[]) => values.map((value) => value * resolution);
    const bounds = this.naming.bounds();
    const sides = placeLabels(
      features.map((feature) => ({
        box: pixels(feature.getGeometry()?.getExtent() ?? []) as Box,
        shape: {
          meets: (box) => feature.getGeometry()?.intersectsExtent(meters(box)) ?? false,
          holds: (point) => feature.getGeometry()?.intersectsCoordinate(meters(point)) ?? false,
        },
        at: pixels((feature.get("at") as PointGeometry).getCoordinates()) as [number, number],
        size: this.naming.sizeOf(feature),
      })),
      bounds && (pixels(bounds) as Box),
    );
    return new Map(features.map((feature, i) => [feature, sides[i]]));
  }
}
