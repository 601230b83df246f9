/** Queries by pointing, drawing and typing; each goes to the source, its answer to the panel. */

import {
  areaContent,
  areaSummary,
  changesContent,
  coverageContent,
  findContent,
  pathContent,
  pointContent,
  unknownContent,
  unreadContent,
  wantedInWords,
  wordsContent,
} from "./answers";
import { complain, el } from "./dom";
import { EvidenceSection } from "./evidence";
import { objectFacts, objectPictures } from "./facts";
import { meters, plural, rounded } from "./format";
import { fromBase } from "./frames";
import { ROOMS } from "./looks";
import type { MapView } from "./mapview";
import type { Panel } from "./panel";
import {
  Refused,
  type Coverage,
  type DataSource,
  type FindAnswer,
  type Frame,
  type MapInfo,
  type ObjectDetails,
  type Past,
  type Point,
  type Ring,
  type ObjectQuery,
  type Version,
} from "./source";
import { changesOf, timeOf } from "./timebar";

const MOST_FOUND = 100;

/** What queries need from the page. */
export interface Context {
  info: MapInfo;
  frame: Frame;
}

/** What the user looks for; without a name to be near to, distances are from the marked place. */
export type Sought = Omit<ObjectQuery, "near"> & { near: string | null };

export class Ask {
  /** The last place that was queried; distances of names are from here. */
  place: Point | null = null;
  /** Adds buttons below an object's facts, if it can be edited. */
  actions: (object: ObjectDetails) => HTMLElement | null = () => null;
  /** Called with the name that was searched for instead of the typed one. */
  sought: (sought: Sought) => void = () => {};
  /** Radius of the robot that paths are for [m]. */
  private robotRadius = 0;
  private last: (() => Promise<void>) | null = null;
  private turn = 0;
  private readonly evidence: EvidenceSection;

  constructor(
    private readonly view: MapView,
    private readonly source: DataSource,
    private readonly panel: Panel,
    private readonly context: Context,
  ) {
    this.evidence = new EvidenceSection(view, source);
  }

  point(place: Point): void {
    this.run(async (isCurrent) => {
      const { info, frame } = this.context;
      const asked = rounded(fromBase(frame, place));
      const answer = await this.source.at(asked, frame.frame_id);
      const objects = answer.layers.flatMap(({ name, objects }) =>
        objects.map(({ id }) => ({ layer: name, id })),
      );
      const only = await this.onlyOne(objects);
      if (!isCurrent()) return;
      this.clear(only);
      this.place = place;
      this.view.markPlace(place);
      const first = answer.layers.flatMap((layer) => layer.objects)[0];
      this.panel.show({
        title: first?.name ?? answer.layers.find(({ label }) => label)?.label ?? "Nothing here",
        summary: `At ${where(asked)} m in ${frame.frame_id}`,
        content: pointContent(
          answer,
          info,
          (layer, id) => this.object(layer, id),
          only && this.facts(only),
        ),
        snippets: answer,
      });
      this.view.reveal(place);
    });
  }

  area(ring: Ring): void {
    this.run(async (isCurrent) => {
      const { info, frame } = this.context;
      const asked = ring.map((point) => rounded(fromBase(frame, point)));
      const answer = await this.source.area(asked, frame.frame_id);
      if (!isCurrent()) return;
      this.clear();
      this.view.markArea(ring);
      this.panel.show({
        title: "In this area",
        summary: areaSummary(answer),
        content: areaContent(
          answer,
          info,
          (layer, id) => this.object(layer, id, true),
          (kind) => this.source.download(kind, asked, frame.frame_id),
        ),
        snippets: answer,
      });
    });
  }

  /** The shortest path; where there is none, the panel says why. */
  path(start: Point, goal: Point): void {
    this.run(async (isCurrent) => {
      const [from, to] = [rounded(start), rounded(goal)];
      const answer = await this.source
        .path?.(from, to, this.robotRadius)
        .catch((error: unknown) => refusal(error));
      if (!isCurrent() || !answer) return;
      this.clear();
      this.view.markPlace(start);
      const isThere = !(answer instanceof Refused);
      if (isThere) this.view.markPath(answer.points);
      this.panel.show({
        title: isThere ? `${meters(answer.length)} m` : "No path",
        summary: `From ${where(from)} to ${where(to)} m in ${this.context.info.base_frame}`,
        content: pathContent(answer, this.robotRadius, (radius) => {
          this.robotRadius = radius;
          this.path(start, goal);
        }),
        snippets: isThere ? answer : undefined,
      });
    });
  }

  /** Lets the camera cover an area. */
  cover(ring: Ring): void {
    const { frame } = this.context;
    const asked = ring.map((point) => rounded(fromBase(frame, point)));
    void this.source
      .cover?.(asked, frame.frame_id)
      .then(() => this.coverage())
      .catch(complain);
  }

  /** What the camera has covered of the area that is being mapped, if there is one. */
  coverage(): void {
    this.run(async (isCurrent) => {
      const answer = await this.source.coverage?.();
      if (!isCurrent()) return;
      if (!answer) return this.panel.close();
      this.clear();
      this.showCoverage(answer);
    });
  }

  private showCoverage(coverage: Coverage): void {
    this.view.markRest(coverage.rest);
    this.view.markArea(coverage.area[0][0]);
    this.panel.show({
      title: "Automap",
      summary: `${Math.round(100 * coverage.share)} % of the area is covered`,
      content: coverageContent(coverage),
    });
  }

  /** Searches for objects; with `focus`, the list of matches gets the keyboard focus. */
  find(sought: Sought, focus = false): void {
    let isNew = true;
    const place = this.place;
    const ring = sought.ring?.map(rounded) ?? null;
    // The current order, so that the matches are in the same order on the way back.
    const near = sought.near ?? rounded(place ?? this.view.center);
    const wanted: ObjectQuery = { ...sought, near, ring };
    this.run(async (isCurrent) => {
      const answer = await this.source.find(wanted, MOST_FOUND);
      const { rows, name, inside } = answer;
      const only = await this.onlyOne(rows);
      if (!isCurrent()) return;
      this.clear(only);
      this.view.markPlace(place);
      this.view.markArea(sought.ring);
      const places = rows.map(({ x, y }): Point => [x, y]);
      this.view.markMatches(places);
      this.panel.show({
        title: wantedInWords({ ...wanted, name, near: answer.near, inside }),
        summary: this.summary(answer, place),
        content: [
          ...unknownContent(answer, this.context.info, (asked, name) =>
            this.instead(sought, asked, name),
          ),
          ...findContent(
            answer,
            this.context.info,
            (row) => this.object(row.layer, row.id, true),
            (rank) => this.view.lookAtMatch(rank),
            only ? this.facts(only) : [],
          ),
        ],
        snippets: answer,
      });
      if (isNew) this.view.showAny(places);
      if (isNew && focus) this.panel.focus();
      isNew = false;
    });
  }

  /** Asks a question in English, from the marked place or the center of the view. */
  question(text: string): void {
    let isNew = true;
    const place = this.place;
    const from = rounded(place ?? this.view.center);
    this.run(async (isCurrent) => {
      const answer = await this.source.ask?.(text, from).catch((error: unknown) => refusal(error));
      if (!isCurrent() || !answer) return;
      if (answer instanceof Refused) {
        this.clear();
        const summary = "This question could not be answered";
        this.panel.show({ title: text, summary, content: unreadContent(answer) });
        return;
      }
      const { rows, rooms, total } = answer;
      const only = await this.onlyOne(rows);
      if (!isCurrent()) return;
      this.clear(only);
      this.view.markPlace(place);
      const places = rows.map(({ x, y }): Point => [x, y]);
      this.view.markMatches(places);
      this.panel.show({
        title: text,
        summary: total ? plural(total, "answer") : "No match in this map",
        content: [
          ...wordsContent(answer),
          ...findContent(
            answer,
            this.context.info,
            (row) => this.object(row.layer, row.id, true),
            (rank) => this.view.lookAtMatch(rank),
            only ? this.facts(only) : [],
          ),
        ],
        snippets: answer,
      });
      if (rooms.length) this.view.markChosen(rooms);
      if (isNew) this.view.showAny(places.length ? places : rooms.flatMap(([outline]) => outline));
      if (isNew) this.panel.focus();
      isNew = false;
    });
  }

  object(layer: string, id: number, fly = false): void {
    const back = this.last;
    this.run(async (isCurrent) => {
      const object = await this.source.object(layer, id);
      if (!isCurrent()) return;
      this.view.markMatches([]);
      this.panel.show({
        title: object.name,
        summary: `Object ${id} of ${layer}`,
        content: this.facts(object, back),
      });
      if (fly) this.view.flyTo(object.at, Math.sqrt(object.area));
    });
  }

  /** Lists what changed in the version of the map that is shown. */
  changes(past: Past, shown: () => Version | undefined, colors: Record<string, string>): void {
    this.run(async (isCurrent) => {
      const version = shown();
      const found = version && (await past.changes(version.version));
      if (!version || !found || !isCurrent()) return;
      this.clear();
      this.panel.show({
        title: timeOf(version),
        summary: changesOf(version),
        content: changesContent(found, colors, ({ at, polygons }) => {
          this.view.markChosen(polygons);
          this.view.flyTo(at, 1);
        }),
      });
    });
  }

  /** Repeats the last query, since the map has changed. */
  refresh(): void {
    if (this.last && this.panel.isOpen) this.again(this.last);
  }

  /** Clears the query and its marks; a pending answer is ignored. */
  forget(): void {
    this.turn++;
    this.last = null;
    this.place = null;
    this.clear();
  }

  private summary({ rows, total, near }: FindAnswer, place: Point | null): string {
    if (!total) return "No match in this map";
    const from = place ? "the marked place" : "the center of the view";
    const order = typeof near === "string" ? "nearest first" : `nearest to ${from} first`;
    const shown = total > rows.length ? `; ${rows.length} shown` : "";
    return `${plural(total, "match", "matches")}, ${order}${shown}`;
  }

  /** Repeats the query with another name in place of an unknown one. */
  private instead(sought: Sought, asked: string, name: string): void {
    const other = (text: string | null) => (text === asked ? name : text);
    const { name: named, near, inside } = sought;
    const better = { ...sought, name: other(named), near: other(near), inside: other(inside) };
    this.sought(better);
    this.find(better, true);
  }

  /** The facts of an object, which is marked on the map, and what can be done with it. */
  private facts(object: ObjectDetails, back: (() => Promise<void>) | null = null): Node[] {
    const { at, area, layer, polygons } = object;
    this.view.markChosen(polygons);
    if (!this.hasEvidence(layer)) this.evidence.close();
    const button = (text: string, onclick: () => void) =>
      el("button", { type: "button", class: "button small", text, onclick });
    return [
      objectPictures(object),
      objectFacts(object, this.context.frame),
      el(
        "div",
        { class: "buttons" },
        back && backButton(() => this.again(back)),
        button("Zoom to it", () => this.view.flyTo(at, Math.sqrt(area))),
        this.actions(object),
      ),
      this.hasEvidence(layer) ? this.evidence.of(object) : null,
    ].filter((node) => node !== null);
  }

  private async onlyOne(hits: { layer: string; id: number }[]): Promise<ObjectDetails | null> {
    return hits.length === 1 ? this.source.object(hits[0].layer, hits[0].id) : null;
  }

  /** Layers of objects can have evidence; rooms, and what another kind of layer draws, have none. */
  private hasEvidence(layer: string): boolean {
    if (layer === ROOMS) return false;
    const { layers } = this.context.info;
    return layers.find(({ name }) => name === layer)?.class_name === "SemanticLayer";
  }

  /** Removes all marks; the evidence of an object stays if it is shown again. */
  private clear(shownNext: ObjectDetails | null = null): void {
    if (!shownNext) this.evidence.close();
    this.view.clearMarks();
  }

  private again(question: () => Promise<void>): void {
    this.last = question;
    void question().catch(complain);
  }

  private run(question: (isCurrent: () => boolean) => Promise<void>): void {
    this.again(() => {
      const turn = ++this.turn;
      return question(() => turn === this.turn);
    });
  }
}

function backButton(onclick: () => void): HTMLElement {
  const data = { back: "" };
  return el("button", { type: "button", class: "button small", text: "Back", data, onclick });
}

const where = ([x, y]: Point): string => `${meters(x)}, ${meters(y)}`;

/** Why the map refused a query; any other error is thrown again. */
function refusal(error: unknown): Refused {
  if (error instanceof Refused && error.status) return error;
  throw error;
}
