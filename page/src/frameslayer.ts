/** Where the map's frames lie: their axes and names. */

import Feature from "ol/Feature.js";
import PointGeometry from "ol/geom/Point.js";
import VectorLayer from "ol/layer/Vector.js";
import VectorSource from "ol/source/Vector.js";
import Fill from "ol/style/Fill.js";
import Icon from "ol/style/Icon.js";
import Stroke from "ol/style/Stroke.js";
import Style from "ol/style/Style.js";
import Text from "ol/style/Text.js";
import { FONT } from "./looks";
import { cssColor } from "./settings";
import type { Frame } from "./source";

const SIZE = 80;

export class FramesLayer {
  readonly layer = new VectorLayer({ source: new VectorSource() });

  setFrames(frames: Frame[]): void {
    const features = frames.map(({ frame_id, x, y, yaw }) => {
      const feature = new Feature(new PointGeometry([x, y]));
      feature.setProperties({ name: frame_id, yaw });
      return feature;
    });
    this.layer.getSource()?.clear(true);
    this.layer.getSource()?.addFeatures(features);
  }

  restyle(): void {
    const image = axes();
    this.layer.setStyle(
      (feature) =>
        new Style({
          image: new Icon({
            img: image,
            size: [SIZE, SIZE],
            rotation: -(feature.get("yaw") as number),
          }),
          text: new Text({
            text: feature.get("name") as string,
            font: `600 12px ${FONT}`,
            offsetY: 14,
            fill: new Fill({ color: cssColor("--label") }),
            stroke: new Stroke({ color: cssColor("--halo"), width: 3 }),
          }),
        }),
    );
  }
}

/** x to the right, y up, from the picture's middle. */
function axes(): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = SIZE;
  const context = canvas.getContext("2d");
  if (!context) return canvas;
  const middle = SIZE / 2;
  const arrow = (color: string, dx: number, dy: number) => {
    const [x, y] = [middle + dx * 34, middle - dy * 34];
    context.strokeStyle = color;
    context.lineWidth = 3;
    context.lineCap = "round";
    context.lineJoin = "round";
    context.beginPath();
    context.moveTo(middle, middle);
    context.lineTo(x, y);
    context.moveTo(x - 6 * dx - 4 * dy, y + 6 * dy - 4 * dx);
    context.lineTo(x, y);
    context.lineTo(x - 6 * dx + 4 * dy, y + 6 * dy + 4 * dx);
    context.stroke();
  };
  arrow(cssColor("--axis-x"), 1, 0);
  arrow(cssColor("--axis-y"), 0, 1);
  return canvas;
}
