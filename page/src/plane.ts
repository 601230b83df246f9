/** What the maps of both pages share: a plane in meters, its view, and layers of features. */

import type Feature from "ol/Feature.js";
import View from "ol/View.js";
import { easeOut } from "ol/easing.js";
import VectorLayer from "ol/layer/Vector.js";
import Projection from "ol/proj/Projection.js";
import VectorSource from "ol/source/Vector.js";
import type { Extent } from "./source";

/** What panels cover of the map [pixels]. */
export interface Insets {
  top: number;
  right: number;
  bottom: number;
  left: number;
}

export const PLANE = new Projection({ code: "meters", units: "m", global: false });

const COARSEST = 100; // meters per pixel: a city

/** A view of the plane, down to a resolution [meters per pixel]. */
export function planeView(minResolution: number): View {
  return new View({
    projection: PLANE,
    center: [0, 0],
    resolution: 0.02,
    minResolution,
    maxResolution: COARSEST,
    enableRotation: false,
    multiWorld: true,
  });
}

export interface Fitting {
  /** Padding around the extent [pixels]. */
  margin: number;
  minResolution?: number;
  animate?: boolean;
  callback?: (isDone: boolean) => void;
}

/** Brings an extent into the part of the map that no panel covers. */
export function fitView(view: View, extent: Extent, insets: Insets, fitting: Fitting): void {
  const { top, right, bottom, left } = insets;
  const { margin, minResolution = 0.002, animate = true, callback } = fitting;
  view.fit(extent, {
    padding: [top + margin, right + margin, bottom + margin, left + margin],
    minResolution,
    duration: animate && !calm() ? 350 : 0,
    easing: easeOut,
    ...(callback ? { callback } : {}),
  });
}

/** Whether the user prefers reduced motion. */
export const calm = (): boolean => window.matchMedia("(prefers-reduced-motion: reduce)").matches;

export type FeatureLayer = VectorLayer<VectorSource>;

export function featureLayer(
  zIndex: number,
  options: { declutter?: boolean; updateWhileInteracting?: boolean } = {},
): FeatureLayer {
  const source = new VectorSource();
  return new VectorLayer({ source, zIndex, updateWhileAnimating: true, ...options });
}

export function setFeatures(layer: FeatureLayer, features: Feature[]): void {
  layer.getSource()?.clear(true);
  layer.getSource()?.addFeatures(features);
}
