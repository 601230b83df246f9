/** A raster layer on the map: tiles in meters, crisp when magnified. */

import TileLayer from "ol/layer/Tile.js";
import ImageTile from "ol/source/ImageTile.js";
import TileGrid from "ol/tilegrid/TileGrid.js";
import { PLANE } from "./plane";
import type { DataSource, LayerInfo } from "./source";
import { coarsestZoom, finestZoom, PIXEL, TILE } from "./zooms";

export function tileLayer(): TileLayer<ImageTile> {
  return new TileLayer<ImageTile>({ className: "raster", cacheSize: 1024 });
}

export function tileSource(info: LayerInfo, source: DataSource, version: number): ImageTile | null {
  if (!info.extent) return null;
  const [finest, coarsest] = [finestZoom(info.resolution ?? 0.05), coarsestZoom(info.extent)];
  const resolutions = [];
  for (let zoom = coarsest; zoom >= finest; zoom--) resolutions.push(PIXEL * 2 ** zoom);
  const tileGrid = new TileGrid({
    origin: [0, 0],
    extent: info.extent,
    resolutions,
    tileSize: TILE,
  });
  return new ImageTile({
    projection: PLANE,
    tileGrid,
    interpolate: false,
    wrapX: false,
    transition: 0,
    // Between two zoom levels, the coarser one: magnified pixels stay, reduced ones would vanish.
    zDirection: 1,
    // OpenLayers counts rows downwards from the origin.
    loader: (z, x, y) => source.tile(info.name, coarsest - z, x, -1 - y, version),
  });
}
