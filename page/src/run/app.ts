/** The page of a run: joins the camera's picture, the map and the timeline. */

import { byId, complain, el, iconButton } from "../dom";
import { count, plural } from "../format";
import type { Insets } from "../plane";
import { showScale } from "../scalebar";
import { loadSettings } from "../settings";
import type { Point } from "../source";
import { ThemeSwitch } from "../theme";
import { CameraView, percent } from "./camera";
import { RunMap } from "./map";
import type { RunInfo, RunSource } from "./source";
import {
  changedBy,
  countsOf,
  Steps,
  thingAt,
  type Counts,
  type RunUpdate,
  type Observation,
  type ObjectStates,
} from "./steps";
import { Timeline } from "./timeline";

export class RunPage {
  readonly steps = new Steps();
  readonly map = new RunMap(byId("map"), insets);
  /** The step that is drawn. */
  shown: { number: number; observation: Observation; things: ObjectStates } | null = null;
  private readonly theme = new ThemeSwitch(loadSettings(), () => {
    this.map.restyle();
    this.timeline.restyle();
  });
  private readonly camera: CameraView;
  private readonly timeline: Timeline;
  private news: RunUpdate | null = null;
  private colors: Record<string, string> = {};
  /** Number of the grid's picture that is drawn. */
  private grid: number | null = null;
  /** Number of the requested step; the drawn one may lag behind. */
  private wanted: number | null = null;
  private isAsking = false;

  constructor(
    private readonly source: RunSource,
    private readonly info: RunInfo,
  ) {
    this.camera = new CameraView(byId<HTMLCanvasElement>("camera"), {
      boxes: true,
      segments: true,
    });
    this.timeline = new Timeline(this.steps, { show: (position) => this.want(position) });
  }

  start(): void {
    const { recording, output } = this.info;
    document.title = `${recording} – Hypermap`;
    byId("title").replaceChildren(recording, el("span", { class: "arrow", text: " → " }), output);
    const fit = iconButton("fit", "Show the whole map (f)", () => this.fit(), { id: "fit" });
    byId("toolbar").replaceChildren(fit, this.theme.button);
    for (const name of ["boxes", "segments"] as const) {
      const box = byId<HTMLInputElement>(`show-${name}`);
      box.addEventListener("change", () => {
        this.camera.options[name] = box.checked;
        this.camera.draw();
      });
    }
    const { map } = this.map;
    map.on("pointermove", ({ pixel, dragging }) => this.tip(dragging ? null : pixel));
    map.getViewport()?.addEventListener("pointerleave", () => this.tip(null));
    const scaled = () => showScale(this.map.resolution);
    map.getView().on("change:resolution", scaled);
    scaled();
    document.addEventListener("keydown", ({ key, ctrlKey, metaKey }) => {
      if (key === "f" && !ctrlKey && !metaKey) this.fit();
    });
    this.theme.apply();
    this.source.watch((news) => this.hear(news));
  }

  private hear(news: RunUpdate | null): void {
    if (!news) {
      if (this.news?.state === "failed") return; // which says enough
      const text =
        this.news?.state === "saved"
          ? "Hypermap has stopped, so other steps cannot be shown."
          : "The server does not respond. Has Hypermap stopped?";
      return banner(text);
    }
    if (news.run !== this.info.id) return location.reload();
    banner(news.state === "failed" ? news.message : null);
    if (news.colors) {
      this.colors = news.colors;
      this.map.setColors(news.colors);
    }
    this.news = news;
    this.steps.take(news.steps);
    this.showState(news);
    if (!this.steps.length) return;
    const position = this.steps.positionOf(this.wanted ?? 0);
    this.timeline.update(position, news.state === "mapping");
    this.want(this.timeline.isLive ? this.steps.length - 1 : position);
  }

  /** Shows the step at a position soon; requests in the meantime are skipped. */
  private want(position: number): void {
    this.wanted = this.steps.numbers[position] ?? null;
    if (!this.isAsking) void this.ask();
  }

  private async ask(): Promise<void> {
    this.isAsking = true;
    try {
      while (this.wanted !== null && this.wanted !== this.shown?.number) {
        await this.show(this.wanted);
      }
    } catch (error) {
      if (this.news?.state === "mapping") complain(error);
    } finally {
      this.isAsking = false;
    }
  }

  private async show(number: number): Promise<void> {
    const before = this.shown;
    const { observation, objects } = await this.source.step(number, before?.number ?? null);
    const grid =
      observation.grid && observation.grid.number !== this.grid ? observation.grid : null;
    const [picture, gridPicture] = await Promise.all([
      this.source.picture(observation.number),
      grid ? this.source.grid(grid.number) : null,
    ]);
    // Everything of a step appears at once.
    const things = changedBy(before?.things ?? new Map(), objects);
    if (grid && gridPicture) {
      this.grid = grid.number;
      this.map.showGrid(gridPicture, grid.extent);
    }
    const position = this.steps.positionOf(observation.number);
    this.camera.show(observation, picture, this.colors);
    this.map.show(observation, things, this.steps.places, position);
    this.showSeen(observation);
    this.showObjects(things);
    byId("frame").textContent = `frame ${count(observation.number)}`;
    this.shown = { number: observation.number, observation, things };
    if (observation.number !== number) this.wanted = observation.number; // the asked one was dropped
  }

  private showState(news: RunUpdate): void {
    const { state, done, total, message, stride } = news;
    document.body.dataset["state"] = state;
    const every = stride > 1 ? `, every ${ordinal(stride)} is recorded` : "";
    byId("state").textContent =
      state === "mapping"
        ? `mapping: ${count(done)} of ${plural(total, "frame")}${every}`
        : state === "saved"
          ? message
          : "mapping has failed";
    const progress = byId<HTMLProgressElement>("progress");
    progress.max = Math.max(1, total);
    progress.value = done;
    progress.hidden = state !== "mapping";
    showCounts(news.counts, news.objects);
    const link = byId<HTMLAnchorElement>("open-map");
    link.hidden = !news.map_url;
    if (news.map_url) link.href = news.map_url;
  }

  private showSeen({ detections }: Observation): void {
    const items = [...detections]
      .sort((a, b) => b.score - a.score)
      .map(({ name, score, footprint }) =>
        el(
          "li",
          { class: footprint.length ? "" : "unused" },
          this.swatch(name),
          el("span", { class: "name grow", text: name }),
          el("span", { class: "quiet", text: footprint.length ? "" : "no shape" }),
          el("span", { class: "score", text: percent(score) }),
        ),
      );
    const nothing = el("li", { class: "quiet", text: "Nothing was detected" });
    byId("seen").replaceChildren(...(items.length ? items : [nothing]));
  }

  private showObjects(things: ObjectStates): void {
    byId("objects-title").textContent = `In the map at this step: ${plural(things.size, "object")}`;
    const items = countsOf(things).map(([name, number]) =>
      el(
        "li",
        {},
        this.swatch(name),
        el("span", { class: "name", text: name }),
        el("span", { class: "number", text: count(number) }),
      ),
    );
    byId("objects").replaceChildren(...items);
  }

  private swatch(name: string): HTMLSpanElement {
    const swatch = el("span", { class: "swatch" });
    swatch.style.background = this.colors[name] ?? "#808080";
    return swatch;
  }

  private tip(pixel: number[] | null): void {
    const tip = byId("tip");
    const at = pixel && (this.map.map.getCoordinateFromPixel(pixel) as Point | null);
    const thing = at && this.shown ? thingAt(this.shown.things, at) : null;
    tip.hidden = !thing;
    if (!pixel || !thing) return;
    const { name, id, evidence, existence } = thing;
    tip.replaceChildren(
      el("b", { text: name }),
      el("span", {
        class: "quiet",
        text: `number ${id} · seen ${evidence}× · existence ${existence.toFixed(1)}`,
      }),
    );
    tip.style.left = `${Math.min(pixel[0] + 14, window.innerWidth - 250)}px`;
    tip.style.top = `${pixel[1] + 16}px`;
  }

  private fit(): void {
    this.map.follows = true;
    this.map.fit();
  }
}

function showCounts({ used, skipped, unusable }: Counts, objects: number): void {
  const rows: [string, number, string][] = [
    ["used", used, "Mapped frames"],
    ["skipped", skipped, "Frames skipped because the camera had hardly moved"],
    ["unusable", unusable, "Frames without depth or without a valid pose"],
    [objects === 1 ? "object" : "objects", objects, "Objects in the map so far"],
  ];
  byId("counts").replaceChildren(
    ...rows.map(([name, number, why]) =>
      el(
        "div",
        { title: why, data: { count: name } },
        el("dt", { text: name }),
        el("dd", { text: count(number) }),
      ),
    ),
  );
}

function ordinal(n: number): string {
  return n === 2 ? "second" : `${n}th`;
}

function banner(text: string | null): void {
  byId("banner").hidden = text === null;
  byId("banner").textContent = text ?? "";
}

/** What the panels cover of the map [pixels]. */
function insets(): Insets {
  const side = byId("sidebar").getBoundingClientRect();
  const foot = byId("foot").getBoundingClientRect();
  const isBeside = side.right < window.innerWidth - 40;
  return {
    top: isBeside ? 56 : side.bottom,
    right: 0,
    bottom: window.innerHeight - foot.top,
    left: isBeside ? side.right : 0,
  };
}
