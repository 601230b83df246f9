/** One raster layer in a page of one file: its pixels, what they say, and tiles of them. */

import { extentOf, holds } from "./geometry";
import type { EmbeddedRaster, Extent, Point, Ring } from "./source";

const TILE = 256;

/** One level of the pyramid; its pixels are `size` m wide, row 0 at the top. */
interface Level {
  canvas: HTMLCanvasElement;
  size: number;
}

export class Raster {
  private readonly levels: Level[];

  private constructor(
    private readonly pixels: ImageData,
    private readonly bounds: Extent,
    private readonly size: number,
    private readonly says: EmbeddedRaster["says"],
  ) {
    this.levels = [{ canvas: canvasOf(pixels), size }];
    for (let level = pixels; Math.max(level.width, level.height) > TILE;) {
      level = halved(level);
      this.levels.push({ canvas: canvasOf(level), size: size * 2 ** this.levels.length });
    }
  }

  static async decode({ png, bounds, resolution, says }: EmbeddedRaster): Promise<Raster> {
    const image = new Image();
    image.src = `data:image/png;base64,${png}`;
    await image.decode();
    const canvas = emptyCanvas(image.naturalWidth, image.naturalHeight);
    const context = contextOf(canvas);
    context.drawImage(image, 0, 0);
    const pixels = context.getImageData(0, 0, canvas.width, canvas.height);
    return new Raster(pixels, bounds, resolution, says);
  }

  tile(zoom: number, column: number, row: number): HTMLCanvasElement {
    const pixel = 0.01 * 2 ** zoom;
    // The finest level that is not finer than the tile: shrunk any further, thin walls would go.
    const level =
      this.levels.find(({ size }) => size >= pixel * 0.999) ?? this.levels[this.levels.length - 1];
    const tile = emptyCanvas(TILE, TILE);
    const context = contextOf(tile);
    context.imageSmoothingEnabled = false;
    const scale = level.size / pixel;
    const left = this.bounds[0] / pixel - column * TILE;
    const top = (row + 1) * TILE - this.bounds[3] / pixel;
    const { canvas } = level;
    context.drawImage(canvas, left, top, canvas.width * scale, canvas.height * scale);
    return tile;
  }

  at(point: Point): { label: string; value: number | null } {
    const { width, height } = this.pixels;
    const column = Math.floor((point[0] - this.bounds[0]) / this.size);
    const row = Math.floor((this.bounds[3] - point[1]) / this.size);
    if (column < 0 || row < 0 || column >= width || row >= height) return OFF;
    return this.says[this.colorAt(row * width + column)] ?? OFF;
  }

  /** How many pixels with their centre in a ring have each label. */
  countsIn(ring: Ring): Map<string, number> {
    const counts = new Map<string, number>();
    const { width, height } = this.pixels;
    const [x0, y0, x1, y1] = extentOf([[ring]]);
    const first = Math.max(0, Math.floor((this.bounds[3] - y1) / this.size));
    const last = Math.min(height - 1, Math.floor((this.bounds[3] - y0) / this.size));
    const left = Math.max(0, Math.floor((x0 - this.bounds[0]) / this.size));
    const right = Math.min(width - 1, Math.floor((x1 - this.bounds[0]) / this.size));
    for (let row = first; row <= last; row++) {
      for (let column = left; column <= right; column++) {
        const x = this.bounds[0] + (column + 0.5) * this.size;
        const y = this.bounds[3] - (row + 0.5) * this.size;
        if (!holds([[ring]], [x, y])) continue;
        const label = this.says[this.colorAt(row * width + column)]?.label ?? OFF.label;
        counts.set(label, (counts.get(label) ?? 0) + 1);
      }
    }
    return counts;
  }

  private colorAt(index: number): string {
    const bytes = this.pixels.data.subarray(4 * index, 4 * index + 4);
    return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
  }
}

/** What Python says off a grid. */
const OFF = { label: "Unknown", value: -1 };

/** Half the size; of four pixels the darkest that is not transparent, so that walls stay. */
function halved({ data, width, height }: ImageData): ImageData {
  const result = new ImageData(Math.ceil(width / 2), Math.ceil(height / 2));
  const from = new Uint32Array(data.buffer);
  const to = new Uint32Array(result.data.buffer);
  for (let row = 0; row < result.height; row++) {
    for (let column = 0; column < result.width; column++) {
      let best = 0;
      let darkest = Infinity;
      for (let r = 2 * row; r < Math.min(height, 2 * row + 2); r++) {
        for (let c = 2 * column; c < Math.min(width, 2 * column + 2); c++) {
          const i = r * width + c;
          if (data[4 * i + 3] === 0) continue;
          const light = data[4 * i] + data[4 * i + 1] + data[4 * i + 2];
          if (light < darkest) [darkest, best] = [light, from[i]];
        }
      }
      to[row * result.width + column] = best;
    }
  }
  return result;
}

function emptyCanvas(width: number, height: number): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  return canvas;
}

function canvasOf(pixels: ImageData): HTMLCanvasElement {
  const canvas = emptyCanvas(pixels.width, pixels.height);
  contextOf(canvas).putImageData(pixels, 0, 0);
  return canvas;
}

function contextOf(canvas: HTMLCanvasElement): CanvasRenderingContext2D {
  const context = canvas.getContext("2d", { willReadFrequently: false });
  if (!context) throw new Error("this browser cannot draw on a canvas");
  return context;
}
