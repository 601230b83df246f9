/** The map inside a single-file page: the same queries, answered here. */

import { findObjects } from "./finding";
import { csv, geojson } from "./format";
import { toBase } from "./frames";
import { extentOf, holds, meet, overlap, wkt } from "./geometry";
import { snippetsInArea, snippetsAt, snippetsForEvidence, snippetsForSearch } from "./snippets";
import { Raster } from "./raster";
import { MeasuredValues, summaryOf } from "./values";
import {
  Refused,
  type AreaAnswer,
  type AreaRow,
  type DataSource,
  type Download,
  type EmbeddedMap,
  type EmbeddedShape,
  type EmbeddedValues,
  type Evidence,
  type Extent,
  type FindAnswer,
  type Frame,
  type LayerAnswer,
  type MapInfo,
  type Note,
  type ObjectDetails,
  type Point,
  type PointAnswer,
  type Ring,
  type Shapes,
  type ObjectQuery,
} from "./source";

export class EmbeddedSource implements DataSource {
  private readonly rasters = new Map<string, Promise<Raster>>();
  private readonly measured = new Map<string, MeasuredValues>();

  constructor(private readonly blob: EmbeddedMap) {
    for (const [name, raster] of Object.entries(blob.rasters)) {
      this.rasters.set(name, Raster.decode(raster));
    }
    for (const [name, values] of Object.entries(blob.values ?? {})) {
      this.measured.set(name, new MeasuredValues(values));
    }
  }

  async map(): Promise<MapInfo> {
    return { ...this.blob.map, editable: false, can_undo: false, can_redo: false, unsaved: false };
  }

  async values(layer: string): Promise<EmbeddedValues> {
    const values = this.blob.values?.[layer];
    if (!values) throw new Refused(`layer "${layer}" has no measured values`, 404);
    return values;
  }

  async notes(): Promise<Note[]> {
    return this.blob.notes ?? [];
  }

  async tile(layer: string, zoom: number, column: number, row: number): Promise<HTMLCanvasElement> {
    return (await this.raster(layer)).tile(zoom, column, row);
  }

  async shapes(
    layer: string,
    extent: Extent,
    _resolution: number,
    names: string[] | null,
  ): Promise<Shapes> {
    const found = this.objects(layer).filter(
      (shape) =>
        (!names || names.includes(shape.name)) && overlap(extentOf(shape.polygons), extent),
    );
    const features = found.sort((a, b) => b.area - a.area).slice(0, MOST);
    return { total: found.length, shown: features.length, features };
  }

  async at(asked: Point, frame: string): Promise<PointAnswer> {
    const point = toBase(this.frame(frame), asked);
    const layers: LayerAnswer[] = [];
    for (const { name, kind } of this.blob.map.layers) {
      const measured = this.measured.get(name);
      if (measured) {
        const here = measured.at(point);
        layers.push({ name, label: measured.text(here), value: here?.value ?? null, objects: [] });
      } else if (kind === "raster") {
        const said = (await this.raster(name)).at(point);
        layers.push({ name, ...said, objects: [] });
      } else if (kind === "shapes") {
        const here = this.objects(name)
          .filter((shape) => holds(shape.polygons, point))
          .sort((a, b) => a.area - b.area);
        const objects = here.map(({ id, name, area, attributes }) => ({
          id,
          name,
          area,
          ...attributes,
        }));
        layers.push({ name, label: here[0]?.name ?? "Empty", value: here[0]?.id ?? -1, objects });
      }
    }
    return {
      point,
      frame,
      layers,
      ...snippetsAt(
        this.blob.map.name,
        asked,
        this.snippets(frame),
        layers.map(({ name }) => name),
      ),
    };
  }

  async area(asked: Ring, frame: string): Promise<AreaAnswer> {
    const ring = this.ring(asked, frame);
    const rows = this.rowsIn(ring).map(({ row }) => row);
    const cells = [];
    for (const { name, kind } of this.blob.map.layers) {
      if (kind !== "raster") continue;
      const measured = this.measured.get(name);
      if (measured) {
        const values = measured.valuesIn(ring);
        const label = summaryOf(measured, values);
        if (label) cells.push({ layer: name, label, count: values.length });
        continue;
      }
      const raster = await this.raster(name);
      for (const [label, count] of raster.countsIn(ring)) {
        cells.push({ layer: name, label, count, about: raster.isReduced });
      }
    }
    return { rows, cells, ...snippetsInArea(this.blob.map.name, asked, this.snippets(frame)) };
  }

  async download(kind: Download, asked: Ring, frame: string): Promise<Blob> {
    const found = this.rowsIn(this.ring(asked, frame));
    if (kind === "csv") return new Blob([csv(found.map(({ row }) => row))], { type: "text/csv" });
    const rows = found.map(({ row, shape }) => ({ ...row, polygons: shape.polygons }));
    return new Blob([geojson(rows)], { type: "application/geo+json" });
  }

  async find(wanted: ObjectQuery, limit: number): Promise<FindAnswer> {
    const { rows, ...understood } = findObjects(this.blob.shapes, wanted);
    return {
      ...understood,
      rows: rows.slice(0, limit),
      total: rows.length,
      ...snippetsForSearch(this.blob.map.name, { ...wanted, ...understood }),
    };
  }

  async object(layer: string, id: number): Promise<ObjectDetails> {
    const shape = this.objects(layer).find((shape) => shape.id === id);
    if (!shape) throw new Refused(`layer "${layer}" has no object ${id}`, 404);
    const { tags, ...attributes } = shape.attributes;
    const { name, area, at, polygons } = shape;
    return {
      layer,
      id,
      name,
      area,
      at,
      polygons,
      wkt: wkt(polygons),
      tags: tagsOf(tags),
      attributes,
    };
  }

  async evidence(layer: string, id: number): Promise<Evidence> {
    const known = this.blob.evidence?.[layer]?.[id];
    const object = await this.object(layer, id);
    if (known) return { ...known, ...snippetsForEvidence(this.blob.map.name, layer, id) };
    return {
      first_seen: numberOf(object.attributes["first_seen"]),
      last_seen: numberOf(object.attributes["last_seen"]),
      seen: 0,
      reason: "This file contains no evidence for this object.",
      observations: [],
      fused: [],
    };
  }

  private objects(layer: string): EmbeddedShape[] {
    return this.blob.shapes[layer] ?? [];
  }

  private raster(layer: string): Promise<Raster> {
    const raster = this.rasters.get(layer);
    if (!raster) throw new Refused(`layer "${layer}" has no picture`, 404);
    return raster;
  }

  private frame(name: string): Frame {
    const frame = this.blob.map.frames.find((frame) => frame.frame_id === name);
    if (!frame) throw new Refused(`the map has no frame "${name}"`, 400);
    return frame;
  }

  private snippets(frame: string): string | null {
    return frame === this.blob.map.base_frame ? null : frame;
  }

  private ring(asked: Ring, frame: string): Ring {
    const pose = this.frame(frame);
    return asked.map((point) => toBase(pose, point));
  }

  private rowsIn(ring: Ring): { row: AreaRow; shape: EmbeddedShape }[] {
    const found = [];
    for (const layer of Object.keys(this.blob.shapes)) {
      for (const shape of this.objects(layer)) {
        if (meet(shape.polygons, [[ring]])) found.push({ row: rowOf(layer, shape), shape });
      }
    }
    return found;
  }
}

/** As many shapes as the map draws at once. */
const MOST = 5000;

function rowOf(layer: string, { id, name, centroid, area, attributes }: EmbeddedShape): AreaRow {
  return {
    layer,
    id,
    name,
    x: centroid[0],
    y: centroid[1],
    area,
    existence: numberOf(attributes["existence"]),
    first_seen: numberOf(attributes["first_seen"]),
    last_seen: numberOf(attributes["last_seen"]),
    tags: tagsOf(attributes["tags"]),
  };
}

const numberOf = (value: unknown): number | null => (typeof value === "number" ? value : null);
const tagsOf = (value: unknown): string[] => (Array.isArray(value) ? value.map(String) : []);
