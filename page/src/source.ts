/** What the page knows about a map, and the queries that it can make: interface to the server. */

/** Meters, in the base frame unless noted otherwise. */
export type Point = [number, number];
export type Ring = Point[];
/** The outer ring, then the holes. */
export type Polygon = Ring[];
/** [x0, y0, x1, y1] */
export type Extent = [number, number, number, number];

export interface Frame {
  frame_id: string;
  /** Its pose in the base frame; yaw in radians. */
  x: number;
  y: number;
  yaw: number;
}

export interface LegendEntry {
  label: string;
  color: string;
}

export interface ClassInfo {
  name: string;
  color: string;
  count: number;
}

export interface LayerInfo {
  name: string;
  class_name: string;
  frame_id: string;
  kind: "raster" | "shapes" | "notes" | "none";
  count: number;
  extent: Extent | null;
  /** Meters per cell, of raster layers. */
  resolution?: number;
  editable?: boolean;
  /** The version in which this layer changed last. */
  version?: number;
  /** Whether it is shown as it was, where the map is. */
  as_it_was?: boolean;
  /** Why it cannot be drawn. */
  problem?: string;
  legend: LegendEntry[];
  classes: ClassInfo[];
}

export interface EditState {
  version: number;
  can_undo: boolean;
  can_redo: boolean;
  unsaved: boolean;
  /** The version that the map had when its file was opened. */
  opened?: number;
}

/** A passage between two rooms. */
export interface Door {
  /** Ids of both. */
  rooms: number[];
  /** Where one room becomes the other. */
  line: Point[];
  /** Diameter of the widest disc that passes [m]. */
  width: number;
}

export interface MapInfo extends EditState {
  name: string;
  /** The file's name, for the commands that are shown. */
  path: string;
  base_frame: string;
  extent: Extent | null;
  editable: boolean;
  frames: Frame[];
  layers: LayerInfo[];
  doors?: Door[];
  /** Whether a node serves the map, and covers areas with its camera. */
  can_cover?: boolean;
  token?: string;
  /** Notes on this map for the user. */
  notes?: string[];
}

export interface Shape {
  id: number;
  name: string;
  polygons?: Polygon[];
  /** In place of polygons, where the shape is smaller than two pixels. */
  point?: Point;
  /** Where a label belongs. */
  at: Point;
  area: number;
}

export interface Shapes {
  total: number;
  shown: number;
  features: Shape[];
}

/** The same query as code. */
export interface Snippets {
  python: string;
  /** Absent where no command asks the same. */
  command?: string;
}

export interface ObjectAt {
  id: number;
  name: string;
  area?: number;
  existence?: number | null;
  tags?: string[];
}

export interface LayerAnswer {
  name: string;
  label: string;
  value: number | null;
  objects: ObjectAt[];
}

export interface PointAnswer extends Snippets {
  /** In the base frame. */
  point: Point;
  frame: string;
  layers: LayerAnswer[];
}

export interface AreaRow {
  layer: string;
  id: number;
  name: string;
  x: number;
  y: number;
  area: number;
  existence: number | null;
  first_seen: number | null;
  last_seen: number | null;
  tags: string[];
}

export interface AreaAnswer extends Snippets {
  rows: AreaRow[];
  /** How many rows there are, where not all are sent. */
  total?: number;
  /** `about`: approximate, from a grid with fewer cells than the layer. */
  cells: { layer: string; label: string; count: number; about?: boolean }[];
}

/** A search: all conditions must be true for an object. */
export interface ObjectQuery {
  /** Null for any. */
  name: string | null;
  /** Where distances are measured from: a place, or the nearest other object of that name. */
  near: Point | string;
  /** The largest distance [m]. */
  within: number | null;
  /** The name of the object that contains their centroid. */
  inside: string | null;
  /** An area that they intersect. */
  ring: Ring | null;
}

export interface FoundRow {
  layer: string;
  id: number;
  name: string;
  x: number;
  y: number;
  /** Null if the query measures none. */
  distance: number | null;
  /** The name of the room that it is in. */
  room?: string;
}

/** `name`, `near` and `inside` as they were understood. */
export interface FindAnswer extends Snippets, Pick<ObjectQuery, "name" | "near" | "inside"> {
  rows: FoundRow[];
  total: number;
  /** Names in the query that no object has, each with similar names. */
  unknown: Record<string, string[]>;
}

export interface ObjectDetails {
  layer: string;
  id: number;
  name: string;
  area: number;
  at: Point;
  polygons: Polygon[];
  wkt: string;
  /** The name of the room that it is in. */
  room?: string;
  /** Of a room: what is behind each of its doors, and how wide it is [m]. */
  doors?: { to: string; width: number }[];
  tags: string[];
  /** One number per tag. */
  confidence?: number[];
  existence?: number | null;
  first_seen?: number | null;
  last_seen?: number | null;
  attributes: Record<string, unknown>;
  /** What the camera saw of it, as data: addresses of JPEG files, the best first. */
  pictures?: string[];
}

/** A question in English, as it was understood, and its answer. */
export interface WordsAnswer extends Snippets {
  question: string;
  /** What was understood: parts of the question, each with its meaning. */
  understood: [string, string][];
  /** The answer in words, as far as the rows do not say it. */
  words: string[];
  rows: FoundRow[];
  /** Of the rooms that are the answer, in the base frame. */
  rooms: Polygon[];
  total: number;
}

/** The shortest way between two places. */
export interface PathAnswer extends Snippets {
  /** Meters. */
  length: number;
  points: Point[];
  rooms: { id: number; name: string }[];
  doors: { place: Point; width: number }[];
}

/** What a camera has covered of an area that is to be mapped. */
export interface Coverage {
  area: Polygon[];
  /** Square meters. */
  size: number;
  /** The covered part, 0 to 1. */
  share: number;
  /** What is not covered. */
  rest: Polygon[];
  rest_size: number;
}

/** One observation of an object. */
export interface Seen {
  /** Seconds. */
  stamp: number;
  /** The detector's score, 0 to 1. */
  score: number;
  polygons: Polygon[];
  /** Square meters. */
  area: number;
  camera: Point;
  /** Where the camera looked [rad]. */
  yaw: number;
  /** From the camera to the shape. */
  distance: number;
}

/** The shape that one method computes from all observations of an object. */
export interface Fused {
  method: string;
  /** Whether the map's shapes were made by it. */
  is_own: boolean;
  area: number;
  /** Jaccard index with the shape in the map. */
  jaccard: number;
  polygons: Polygon[];
}

/** The evidence for an object. */
export interface Evidence extends Partial<Snippets> {
  first_seen: number | null;
  last_seen: number | null;
  /** How often it was seen; older observations may not be kept. */
  seen: number;
  /** The first stamp of all that is kept in the layer. */
  start?: number;
  /** Why there are no observations. */
  reason?: string;
  observations: Seen[];
  fused: Fused[];
}

/** A file attached to a note. */
export interface NoteFile {
  name: string;
  /** "file" is for download alone. */
  kind: "picture" | "sound" | "video" | "file";
  /** In bytes. */
  size: number;
  sha256: string;
  /** False if it lay next to the map and was left behind. */
  is_there: boolean;
  /** Absent in a single-file page that does not hold it. */
  url?: string;
}

/** A note at a place. */
export interface Note {
  layer: string;
  id: number;
  title: string;
  /** Markdown, and the same as safe HTML. */
  text: string;
  html: string;
  author: string;
  /** ISO 8601, with the zone of the author. */
  time: string;
  changed: string | null;
  /** Where it is marked. */
  at: Point;
  /** Of an area; empty for a point. */
  polygons: Polygon[];
  links: string[];
  files: NoteFile[];
}

export interface Operation {
  /** "add_layer" adds one without objects; a following "add" may draw on it. */
  op:
    | "add"
    | "add_layer"
    | "find_rooms"
    | "update"
    | "merge"
    | "split"
    | "remove"
    | "add_note"
    | "update_note"
    | "remove_note";
  layer: string;
  id?: number;
  name?: string;
  polygons?: Polygon[];
  tags?: string[];
  /** Of "add": the object that it is a copy of; tags and attributes are taken from it. */
  like?: number;
  /** Of "merge": the objects that become part of this one. */
  others?: number[];
  /** Of "split": across the room. */
  line?: Point[];
  /** Of a note: where it is, what it says, and the hashes of all its files. */
  point?: Point;
  text?: string;
  author?: string;
  links?: string[];
  files?: string[];
}

export interface Change extends Partial<EditState> {
  ids?: number[];
  /** Names of the layers that changed. */
  layers?: string[];
  saved?: boolean;
  disk?: "changed" | "vanished";
}

export interface SaveRequest {
  path?: string;
  overwrite?: boolean;
}

export type Download = "csv" | "geojson";
export type TileImage = HTMLImageElement | HTMLCanvasElement | ImageBitmap;

/** A failed query: why the server or the map refused it. */
export class Refused extends Error {
  constructor(
    message: string,
    readonly status: number,
    /** Of a 409: "behind", "disk" or "exists". */
    readonly reason: string = "",
  ) {
    super(message);
  }
}

export interface Questions {
  map(): Promise<MapInfo>;
  /** One tile of 256 x 256 pixels of 0.01 * 2^zoom m; row grows along y. */
  tile(
    layer: string,
    zoom: number,
    column: number,
    row: number,
    version: number,
  ): Promise<TileImage>;
  /** What meets an extent, at so many meters per pixel; only these names, if any are given. */
  shapes(
    layer: string,
    extent: Extent,
    resolution: number,
    names: string[] | null,
    version: number,
    signal: AbortSignal,
  ): Promise<Shapes>;
  at(point: Point, frame: string): Promise<PointAnswer>;
  area(ring: Ring, frame: string): Promise<AreaAnswer>;
  download(kind: Download, ring: Ring, frame: string): Promise<Blob>;
  find(wanted: ObjectQuery, limit: number): Promise<FindAnswer>;
  object(layer: string, id: number): Promise<ObjectDetails>;
  evidence(layer: string, id: number): Promise<Evidence>;
  /** The numbers of a layer of measured values. */
  values(layer: string, version: number): Promise<EmbeddedValues>;
  /** All notes. */
  notes?(): Promise<Note[]>;
  /** A question in English, asked from a place. Absent if nobody can read it. */
  ask?(question: string, place: Point): Promise<WordsAnswer>;
  /** For a robot of a radius [m]. Absent if there is no planner. */
  path?(start: Point, goal: Point, radius: number): Promise<PathAnswer>;
  /** What is covered of the area that is being mapped; null while there is none. */
  coverage?(): Promise<Coverage | null>;
  /** Begins with an area. Absent, as `coverage`, if no node can serve the map. */
  cover?(ring: Ring, frame: string): Promise<Coverage | null>;
}

export interface Editing {
  /** An object, or null if it was deleted. */
  objectIfThere(layer: string, id: number): Promise<ObjectDetails | null>;
  edit(version: number, operations: Operation[]): Promise<Change>;
  /** Sends a file, which a note may have then. */
  upload(file: File): Promise<{ sha256: string }>;
  undo(version: number): Promise<Change>;
  redo(version: number): Promise<Change>;
  save(request: SaveRequest): Promise<Change>;
  /** Reloads the file; unsaved changes are lost. */
  reload(): Promise<Change>;
  /**
   * Calls back on every change, from this window or another; `lost` when the server does not
   * respond, and `refused` when it does, but does not know this window, as after a restart.
   */
  watch(changed: (change: Change | "lost" | "refused") => void): void;
}

/** A version of the map, and how many objects it changed, by kind of change, or "doubtful". */
export interface Version {
  version: number;
  /** In seconds since 1970; null where the recording's clock does not say it. */
  time: number | null;
  cause: "mapping" | "edit";
  /** Name of the recording; empty for edits. */
  drive: string;
  changes: Record<string, number>;
}

/** The versions that can be shown, oldest first; the last one is the map as it is. */
export interface MapTimeline {
  versions: Version[];
  /** By kind of change. */
  colors: Record<string, string>;
}

export interface ChangeEnd {
  name: string;
  at: Point;
  polygons: Polygon[];
}

/** How one object changed; before or after is null where it was not there. */
export interface ObjectChange {
  kind: string;
  layer: string;
  id: number;
  /** How far its center moved [m]. */
  distance: number | null;
  /** How likely both are one object, 0..1. */
  confidence: number | null;
  before: ChangeEnd | null;
  after: ChangeEnd | null;
}

export interface VersionChanges {
  /** There may be more than those that are listed. */
  total: number;
  /** How many more are left out, as their objects probably did not come or go. */
  doubtful: number;
  changes: ObjectChange[];
}

export interface Past {
  timeline(): Promise<MapTimeline>;
  changes(version: number): Promise<VersionChanges>;
  /** From now on, all questions are about the map as it was in a version; null for as it is. */
  goTo(version: number | null): void;
}

export interface DataSource extends Questions {
  /** Absent where the map's history is not known. */
  readonly past?: Past;
  /** Absent if the map is read-only. */
  readonly editing?: Editing;
}

/** The map inside a page that was written as one file. */
export interface EmbeddedMap {
  version: 1;
  map: MapInfo;
  rasters: Record<string, EmbeddedRaster>;
  shapes: Record<string, EmbeddedShape[]>;
  /** Of layers of measured values. */
  values?: Record<string, EmbeddedValues>;
  /** By layer and id. */
  evidence?: Record<string, Record<string, Evidence>>;
  notes?: Note[];
}

export interface EmbeddedRaster {
  /** Base64 of a PNG that lies straight in the base frame; its first row has the largest y. */
  png: string;
  bounds: Extent;
  /** Meters per pixel. */
  resolution: number;
  /** The cells that are drawn: the pose of their corner in the base frame, their side, how many. */
  grid: { x: number; y: number; yaw: number; resolution: number; width: number; height: number };
  /** How many of the layer's cells, along a side, became one of those. */
  reduced_by: number;
  /** What a pixel of the color "rrggbbaa" says. */
  says: Record<string, { label: string; value: number | null }>;
}

/** Whole numbers of 16 bits, little-endian, in Base64; each is `low` and so many steps; the largest
 * one says that nothing is known. */
interface PackedNumbers {
  low: number;
  step: number;
  numbers: string;
}

/** Measured values and their standard deviations, by rows from the grid's origin. */
export interface EmbeddedValues {
  quantity: string;
  unit: string;
  /** How many of them are shown. */
  decimals: number;
  /** The pose of its corner in the base frame, the side of a cell, how many cells. */
  grid: EmbeddedRaster["grid"];
  values: PackedNumbers;
  deviations: PackedNumbers | null;
}

export interface EmbeddedShape {
  id: number;
  name: string;
  polygons: Polygon[];
  /** Where a label belongs: inside. */
  at: Point;
  /** What questions give as the object's place. */
  centroid: Point;
  area: number;
  attributes: Record<string, unknown>;
}
