/** One raster layer in a single-file page: its pixels, their values, and tiles of them. */

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
    private readonly grid: EmbeddedRaster["grid"],
    private readonly reducedBy: number,
  ) {
    this.levels = [{ canvas: canvasOf(pixels), size }];
    for (let level = pixels; Math.max(level.width, level.height) > TILE;) {
      level = halved(level);
      this.levels.push({ canvas: canvasOf(level), size: size * 2 ** this.levels.length });
    }
  }

  static async decode(embedded: EmbeddedRaster): Promise<Raster> {
    const { png, bounds, resolution, says, grid, reduced_by } = embedded;
    const image = new Image();
    image.src = `data:image/png;base64,${png}`;
    await image.decode();
    const canvas = emptyCanvas(image.naturalWidth, image.naturalHeight);
    const context = contextOf(canvas);
    context.drawImage(image, 0, 0);
    const pixels = context.getImageData(0, 0, canvas.width, canvas.height);
    return new Raster(pixels, bounds, resolution, says, grid, reduced_by);
  }

  tile(zoom: number, column: number, row: number): HTMLCanvasElement {
    const pixel = 0.01 * 2 ** zoom;
    // The finest level not finer than the tile: reduced any further, thin walls would vanish.
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
    const [column, row] = this.inCells(point).map(Math.floor);
    return this.says[this.colorOf(column, row)] ?? OFF;
  }

  /** Whether counts are of cells that are coarser than the layer's. */
  get isReduced(): boolean {
    return this.reducedBy > 1;
  }

  /** How many of the layer's cells with their center in a ring have each label. */
  countsIn(ring: Ring): Map<string, number> {
    const counts = new Map<string, number>();
    const { width, height } = this.grid;
    const inCells = ring.map((point) => this.inCells(point));
    const [x0, y0, x1, y1] = extentOf([[inCells]]);
    const [left, right] = [Math.max(0, Math.floor(x0)), Math.min(width - 1, Math.floor(x1))];
    const [first, last] = [Math.max(0, Math.floor(y0)), Math.min(height - 1, Math.floor(y1))];
    for (let row = first; row <= last; row++) {
      for (let column = left; column <= right; column++) {
        if (!holds([[inCells]], [column + 0.5, row + 0.5])) continue;
        const { label } = this.says[this.colorOf(column, row)] ?? OFF;
        counts.set(label, (counts.get(label) ?? 0) + this.reducedBy ** 2);
      }
    }
    return counts;
  }

  /** A point of the base frame in cells from the corner of the grid. */
  private inCells([x, y]: Point): Point {
    const { x: x0, y: y0, yaw, resolution } = this.grid;
    const [cos, sin] = [Math.cos(yaw) / resolution, Math.sin(yaw) / resolution];
    return [cos * (x - x0) + sin * (y - y0), cos * (y - y0) - sin * (x - x0)];
  }

  /** The color of a cell: that of the pixel over its center, also where the grid is turned. */
  private colorOf(column: number, row: number): string {
    const { x: x0, y: y0, yaw, resolution, width, height } = this.grid;
    if (column < 0 || row < 0 || column >= width || row >= height) return "";
    const [u, v] = [(column + 0.5) * resolution, (row + 0.5) * resolution];
    const x = x0 + Math.cos(yaw) * u - Math.sin(yaw) * v;
    const y = y0 + Math.sin(yaw) * u + Math.cos(yaw) * v;
    const pixelColumn = Math.floor((x - this.bounds[0]) / this.size);
    const pixelRow = Math.floor((this.bounds[3] - y) / this.size);
    return this.colorAt(pixelRow * this.pixels.width + pixelColumn);
  }

  private colorAt(index: number): string {
    const bytes = this.pixels.data.subarray(4 * index, 4 * index + 4);
    return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
  }
}

/** The value off a grid, as in Python. */
const OFF = { label: "Unknown", value: -1 };

/** Half the size: of four pixels, the darkest that is not transparent, so that walls remain. */
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
