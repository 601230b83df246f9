/** The map behind `hypermap view`: queries and changes over HTTP. */

import {
  Refused,
  type AreaAnswer,
  type Change,
  type Coverage,
  type DataSource,
  type Download,
  type Editing,
  type EmbeddedValues,
  type Evidence,
  type Extent,
  type FindAnswer,
  type MapInfo,
  type Note,
  type MapTimeline,
  type ObjectDetails,
  type Past,
  type PathAnswer,
  type Operation,
  type Point,
  type PointAnswer,
  type Ring,
  type SaveRequest,
  type Shapes,
  type ObjectQuery,
  type VersionChanges,
  type WordsAnswer,
} from "./source";

type Values = Record<string, string | number | string[] | undefined>;

export class ServerSource implements DataSource, Editing, Past {
  readonly editing: Editing = this;
  readonly past: Past = this;
  private token = "";
  private base = "";
  /** The version that is asked about; undefined for the map as it is. */
  private asOf: number | undefined;

  async map(): Promise<MapInfo> {
    const info = await this.get<MapInfo>("api/map", {});
    this.token = info.token ?? "";
    this.base = info.base_frame;
    return info;
  }

  tile(
    layer: string,
    zoom: number,
    column: number,
    row: number,
    v: number,
  ): Promise<HTMLImageElement> {
    return new Promise((resolve, reject) => {
      const image = new Image();
      image.onload = () => resolve(image);
      image.onerror = () => reject(new Error(`no tile ${zoom}/${column}/${row} of ${layer}`));
      image.src = address(`api/tiles/${encodeURIComponent(layer)}/${zoom}/${column}/${row}.png`, {
        v,
        as_of: v === this.asOf ? v : undefined, // of a layer that is shown as it was
      });
    });
  }

  shapes(
    layer: string,
    extent: Extent,
    resolution: number,
    names: string[] | null,
    v: number,
    signal: AbortSignal,
  ): Promise<Shapes> {
    const values: Values = { bbox: extent.join(","), resolution, v };
    if (names) values["name"] = names;
    return this.get(`api/shapes/${encodeURIComponent(layer)}`, values, signal);
  }

  at([x, y]: Point, frame: string): Promise<PointAnswer> {
    return this.get("api/at", { x, y, ...this.inFrame(frame) });
  }

  area(polygon: Ring, frame: string): Promise<AreaAnswer> {
    const url = address("api/area", { as_of: this.asOf });
    return this.post(url, { polygon, ...this.inFrame(frame) });
  }

  async download(kind: Download, ring: Ring, frame: string): Promise<Blob> {
    const values = {
      polygon: ring.flat().join(","),
      ...this.inFrame(frame),
      as_of: this.asOf,
    };
    return (await ask(address(`api/area.${kind}`, values), {})).blob();
  }

  find({ name, near, within, inside, ring }: ObjectQuery, limit: number): Promise<FindAnswer> {
    return this.get("api/find", {
      name: name ?? undefined,
      near: typeof near === "string" ? near : near.join(","),
      within: within ?? undefined,
      inside: inside ?? undefined,
      polygon: ring?.flat().join(","),
      limit,
    });
  }

  ask(question: string, place: Point): Promise<WordsAnswer> {
    return this.get("api/ask", { question, from: place.join(",") });
  }

  object(layer: string, id: number): Promise<ObjectDetails> {
    return this.get(`api/objects/${encodeURIComponent(layer)}/${id}`, {});
  }

  objectIfThere(layer: string, id: number): Promise<ObjectDetails | null> {
    return this.get(`api/objects/${encodeURIComponent(layer)}/${id}`, { if_there: 1 });
  }

  evidence(layer: string, id: number): Promise<Evidence> {
    return this.get(`api/objects/${encodeURIComponent(layer)}/${id}/evidence`, {});
  }

  path(start: Point, goal: Point, radius: number): Promise<PathAnswer> {
    return this.get("api/path", { from: start.join(","), to: goal.join(","), radius });
  }

  coverage(): Promise<Coverage | null> {
    return this.get("api/coverage", {});
  }

  cover(polygon: Ring, frame: string): Promise<Coverage | null> {
    return this.post("api/coverage", { polygon, ...this.inFrame(frame) });
  }

  values(layer: string, v: number): Promise<EmbeddedValues> {
    return this.get(`api/values/${encodeURIComponent(layer)}`, { v });
  }

  notes(): Promise<Note[]> {
    return this.get("api/notes", {});
  }

  timeline(): Promise<MapTimeline> {
    return this.get("api/timeline", {});
  }

  changes(version: number): Promise<VersionChanges> {
    return this.get(`api/timeline/${version}`, {});
  }

  goTo(version: number | null): void {
    this.asOf = version ?? undefined;
  }

  async upload(file: File): Promise<{ sha256: string }> {
    const headers = { "X-Hypermap-Token": this.token };
    const url = address("api/files", { name: file.name });
    const answer = await ask(url, { method: "POST", headers, body: file });
    return answer.json() as Promise<{ sha256: string }>;
  }

  edit(version: number, operations: Operation[]): Promise<Change> {
    return this.post("api/edit", { version, operations });
  }

  undo(version: number): Promise<Change> {
    return this.post("api/undo", { version });
  }

  redo(version: number): Promise<Change> {
    return this.post("api/redo", { version });
  }

  save(request: SaveRequest): Promise<Change> {
    return this.post("api/save", request);
  }

  reload(): Promise<Change> {
    return this.post("api/reload", {});
  }

  watch(changed: (change: Change | "lost" | "refused") => void): void {
    const events = new EventSource("api/events");
    let lost = false;
    events.onmessage = (event: MessageEvent<string>) => changed(JSON.parse(event.data) as Change);
    events.onerror = () => {
      if (!lost) changed("lost");
      lost = true;
      if (events.readyState !== EventSource.CLOSED) return; // it tries again
      fetch("api/map").then(
        ({ status }) => status === FORBIDDEN && changed("refused"),
        () => undefined,
      );
    };
    events.onopen = () => {
      // What happened in between is not known, so everything is loaded again.
      if (lost) changed({});
      lost = false;
    };
  }

  /** Queries in the base frame, and the code for them, need not name it. */
  private inFrame(frame: string): { frame?: string } {
    return frame === this.base ? {} : { frame };
  }

  private async get<T>(path: string, values: Values, signal?: AbortSignal): Promise<T> {
    const url = address(path, { ...values, as_of: this.asOf });
    return (await ask(url, { signal })).json() as Promise<T>;
  }

  private async post<T>(path: string, body: unknown): Promise<T> {
    const answer = await ask(path, {
      method: "POST",
      headers: { "Content-Type": "application/json", "X-Hypermap-Token": this.token },
      body: JSON.stringify(body),
    });
    return answer.json() as Promise<T>;
  }
}

const FORBIDDEN = 403;

function address(path: string, values: Values): string {
  const query = new URLSearchParams();
  for (const [key, value] of Object.entries(values)) {
    if (value === undefined) continue;
    for (const one of Array.isArray(value) ? value : [value]) query.append(key, String(one));
  }
  return `${path}?${query}`;
}

export async function ask(url: string, options: RequestInit): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(url, options);
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new Refused("The server does not respond. Is `hypermap view` still running?", 0);
  }
  if (answer.ok) return answer;
  const said = (await answer.json().catch(() => ({}))) as { error?: string; reason?: string };
  throw new Refused(
    said.error ?? `the server answers ${answer.status}`,
    answer.status,
    said.reason,
  );
}
