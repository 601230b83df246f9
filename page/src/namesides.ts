/** On which side of its shape each name stands, worked out once for each scale. */

import type Feature from "ol/Feature.js";
import type PointGeometry from "ol/geom/Point.js";
import { placeLabels, type Box, type Side } from "./labels";
import type { Extent } from "./source";

export interface Naming {
  /** Those that are named at so many meters per pixel. */
  features: (resolution: number) => Feature[];
  /** Of a feature's name [pixels]. */
  sizeOf: (feature: Feature) => [number, number];
  /** Names stand in it rather than outside: that is what one looks at. */
  bounds: () => Extent | null;
}

export class NameSides {
  private known: { resolution: number; sides: Map<Feature, Side | null> } | null = null;

  constructor(private readonly naming: Naming) {}

  /** To be called when features or names have changed. */
  forget(): void {
    this.known = null;
  }

  /** The side of a feature's name; null where it has none, or no room. */
  of(feature: Feature, resolution: number): Side | null {
    if (this.known?.resolution !== resolution) {
      this.known = { resolution, sides: this.place(resolution) };
    }
    return this.known.sides.get(feature) ?? null;
  }

  private place(resolution: number): Map<Feature, Side | null> {
    const features = this.naming.features(resolution);
    const pixels = (values: number[]) => values.map((value) => value / resolution);
    const bounds = this.naming.bounds();
    const sides = placeLabels(
      features.map((feature) => ({
        box: pixels(feature.getGeometry()?.getExtent() ?? []) as Box,
        at: pixels((feature.get("at") as PointGeometry).getCoordinates()) as [number, number],
        size: this.naming.sizeOf(feature),
      })),
      bounds && (pixels(bounds) as Box),
    );
    return new Map(features.map((feature, i) => [feature, sides[i]]));
  }
}
