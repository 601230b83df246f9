/** Questions by pointing, drawing and typing; each goes to the source, its answer to the panel. */

import { areaContent, areaSummary, findContent, objectContent, pointContent } from "./answers";
import { complain, el } from "./dom";
import { BehindSection } from "./evidence";
import { metres, plural, rounded } from "./format";
import { fromBase } from "./frames";
import type { MapView } from "./mapview";
import type { Panel } from "./panel";
import type { DataSource, Frame, MapInfo, ObjectDetails, Point, Ring } from "./source";

const MOST_FOUND = 100;

/** What the questions need to know of the page. */
export interface Context {
  info: MapInfo;
  frame: Frame;
}

export class Ask {
  /** The place asked last; names are sought from here. */
  place: Point | null = null;
  /** Puts buttons under an object's facts, where it can be edited. */
  actions: (object: ObjectDetails) => HTMLElement | null = () => null;
  private last: (() => Promise<void>) | null = null;
  private turn = 0;
  private readonly behind: BehindSection;

  constructor(
    private readonly view: MapView,
    private readonly source: DataSource,
    private readonly panel: Panel,
    private readonly context: Context,
  ) {
    this.behind = new BehindSection(view, source);
  }

  point(place: Point): void {
    this.run(async (isCurrent) => {
      const { info, frame } = this.context;
      const asked = rounded(fromBase(frame, place));
      const answer = await this.source.at(asked, frame.frame_id);
      if (!isCurrent()) return;
      this.clear();
      this.place = place;
      this.view.markPlace(place);
      const objects = answer.layers.flatMap((layer) => layer.objects);
      this.panel.show({
        title:
          objects[0]?.name ?? answer.layers.find(({ label }) => label)?.label ?? "Nothing here",
        summary: `At ${where(asked)} m in ${frame.frame_id}`,
        content: pointContent(answer, info, (layer, id) => this.object(layer, id)),
        spelled: answer,
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
        spelled: answer,
      });
    });
  }

  name(name: string): void {
    let isNew = true;
    this.run(async (isCurrent) => {
      const { info } = this.context;
      const place = this.place;
      const answer = await this.source.find(name, rounded(place ?? this.view.center), MOST_FOUND);
      if (!isCurrent()) return;
      const { rows } = answer;
      this.clear();
      this.view.markPlace(place);
      const places = rows.map(({ x, y }): Point => [x, y]);
      this.view.markMatches(places);
      const total = answer.total ?? rows.length;
      const from = place ? "the marked place" : "the middle of the view";
      this.panel.show({
        title: name,
        summary: total
          ? `${plural(total, "match", "matches")}, nearest to ${from} first` +
            (total > rows.length ? `; ${rows.length} shown` : "")
          : "Nothing in this map has that name",
        content: findContent(answer, info, (row) => {
          void this.choose(row.layer, row.id).catch(complain);
        }),
        spelled: answer,
      });
      if (isNew) this.view.showAny(places);
      isNew = false;
    });
  }

  object(layer: string, id: number, fly = false): void {
    const back = this.last;
    this.run(async (isCurrent) => {
      const object = await this.source.object(layer, id);
      if (!isCurrent()) return;
      this.view.markMatches([]);
      this.view.markChosen(object.polygons);
      const behind = this.hasEvidence(layer) ? this.behind.of(object) : null;
      this.panel.show({
        title: object.name,
        summary: `Object ${id} of ${layer}`,
        content: [
          ...objectContent(object),
          el(
            "div",
            { class: "buttons" },
            back
              ? el("button", {
                  type: "button",
                  class: "button small",
                  text: "Back",
                  onclick: () => this.again(back),
                })
              : null,
            el("button", {
              type: "button",
              class: "button small",
              text: "Zoom to it",
              onclick: () => this.view.flyTo(object.at, Math.sqrt(object.area)),
            }),
            this.actions(object),
          ),
          behind,
        ],
      });
      if (fly) this.view.flyTo(object.at, Math.sqrt(object.area));
    });
  }

  /** Layers of objects can have evidence; those that another kind of layer draws have none. */
  private hasEvidence(layer: string): boolean {
    const { layers } = this.context.info;
    return layers.find(({ name }) => name === layer)?.class_name === "SemanticLayer";
  }

  /** Flies to a match; the list of matches stays. */
  private async choose(layer: string, id: number): Promise<void> {
    const object = await this.source.object(layer, id);
    this.view.markChosen(object.polygons);
    this.view.flyTo(object.at, Math.sqrt(object.area));
  }

  /** Asks the last question anew, since the map has changed. */
  refresh(): void {
    if (this.last && this.panel.isOpen) this.again(this.last);
  }

  /** Forgets question and marks; an answer under way comes too late. */
  forget(): void {
    this.turn++;
    this.last = null;
    this.place = null;
    this.clear();
  }

  private clear(): void {
    this.behind.close();
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

const where = ([x, y]: Point): string => `${metres(x)}, ${metres(y)}`;
