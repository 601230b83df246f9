/** The scale bar at the foot of the map. */

import { byId } from "./dom";
import { length, niceLength } from "./format";

/** The scale bar is not longer than this [pixels]. */
const LONGEST = 120;

/** Shows a round length at a resolution [meters per pixel]. */
export function showScale(resolution: number): void {
  const meters = niceLength(LONGEST * resolution);
  byId("scale-text").textContent = length(meters);
  byId("scale-bar").style.width = `${meters / resolution}px`;
}
