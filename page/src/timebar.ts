/** The timeline of the map: a step for each version that changed an object, back and forth. */

import { byId, complain, el, icon, iconButton } from "./dom";
import { stamp } from "./format";
import type { MapTimeline, Version } from "./source";

export interface TimeVerbs {
  /** Shows the map as it was in a version. */
  show: (version: Version, isNow: boolean) => Promise<void>;
  /** Lists what changed in the version that is shown. */
  list: () => void;
  close: () => void;
}

/** How long each version is shown while the timeline plays [ms]. */
const STEP = 1200;
const [HEIGHT, LOWEST] = [24, 4];
const SVG = "http://www.w3.org/2000/svg";

export class TimeBar {
  colors: Record<string, string> = {};
  private versions: Version[] = [];
  private position = 0;
  /** Grows when playing begins or ends, so that what was begun before stops. */
  private run = 0;
  private isPlaying = false;
  private readonly element = byId("timebar");
  private readonly slider: HTMLInputElement;
  private readonly marks = document.createElementNS(SVG, "svg");
  private readonly play: HTMLButtonElement;
  private readonly when = el("output", { id: "when", aria: { live: "off" } });
  private readonly what: HTMLButtonElement;

  constructor(private readonly verbs: TimeVerbs) {
    this.slider = el("input", {
      type: "range",
      id: "version",
      aria: { label: "Version of the map" },
      oninput: () => this.choose(Number(this.slider.value)),
    });
    this.slider.min = "0";
    this.slider.addEventListener("keydown", (event) => {
      if (event.key !== " ") return;
      event.preventDefault();
      this.togglePlay();
    });
    this.marks.classList.add("version-marks");
    this.marks.setAttribute("aria-hidden", "true");
    this.marks.setAttribute("preserveAspectRatio", "none");
    this.play = iconButton("play", "Play", () => this.togglePlay(), { id: "play-versions" });
    const title = "List what changed";
    this.what = el("button", { type: "button", id: "what-changed", class: "tool", title });
    this.what.onclick = () => verbs.list();
    this.element.replaceChildren(
      iconButton("back", "The previous version", () => this.choose(this.position - 1)),
      this.play,
      iconButton("forth", "The next version", () => this.choose(this.position + 1)),
      el("div", { class: "version-track" }, this.marks, this.slider),
      el("div", { class: "version-said" }, this.when, this.what),
      iconButton("close", "Close the timeline", () => verbs.close()),
    );
  }

  get isOpen(): boolean {
    return !this.element.hidden;
  }

  /** Whether there is anything but the present. */
  get hasPast(): boolean {
    return this.versions.length > 1;
  }

  get isNow(): boolean {
    return this.position >= this.versions.length - 1;
  }

  /** Whether the version that is shown is the first one, to which all that it has is new. */
  get isFirst(): boolean {
    return this.position === 0;
  }

  get shown(): Version | undefined {
    return this.versions[this.position];
  }

  /** Takes the versions of the map; the shown one stays, or it is the last one. */
  update({ versions, colors }: MapTimeline): void {
    const before = this.isNow ? undefined : this.shown?.version;
    this.versions = versions;
    this.colors = colors;
    const found = versions.findIndex(({ version }) => version === before);
    this.position = found < 0 ? Math.max(0, versions.length - 1) : found;
    this.slider.max = String(Math.max(0, versions.length - 1));
    this.drawMarks();
    this.draw();
  }

  open(): void {
    this.element.hidden = false;
    this.slider.focus();
  }

  /** Returns to the present and disappears. */
  close(): void {
    this.pause();
    this.element.hidden = true;
    this.position = Math.max(0, this.versions.length - 1);
    this.draw();
  }

  private choose(position: number): void {
    this.pause();
    void this.goTo(position).catch(complain);
  }

  private async goTo(position: number): Promise<void> {
    const last = this.versions.length - 1;
    this.position = Math.max(0, Math.min(last, position));
    this.draw();
    if (this.shown) await this.verbs.show(this.shown, this.isNow);
  }

  private togglePlay(): void {
    if (this.isPlaying) return this.pause();
    const run = ++this.run;
    this.isPlaying = true;
    const step = async () => {
      await this.goTo(this.isNow ? 0 : this.position + 1);
      if (run !== this.run) return;
      if (this.isNow) return this.pause();
      window.setTimeout(() => run === this.run && void step().catch(complain), STEP);
    };
    void step().catch(complain);
    this.draw();
  }

  private pause(): void {
    this.run++;
    this.isPlaying = false;
    this.draw();
  }

  private draw(): void {
    const label = this.isPlaying ? "Pause (space)" : "Play (space)";
    this.play.replaceChildren(icon(this.isPlaying ? "pause" : "play"));
    this.play.title = label;
    this.play.setAttribute("aria-label", label);
    this.slider.value = String(this.position);
    const { shown } = this;
    if (!shown) return;
    const [time, what] = [timeOf(shown), changesOf(shown)];
    const by = shown.cause === "edit" ? "edited" : shown.drive;
    this.when.replaceChildren(el("b", { text: this.isNow ? "Now" : time }), by ? ` ${by}` : "");
    this.when.title = `Version ${shown.version}, ${time}`;
    this.what.textContent = what;
    this.slider.setAttribute("aria-valuetext", `${this.isNow ? "Now, " : ""}${time}: ${what}`);
  }

  /** A bar for each version, the higher the more objects it changed. */
  private drawMarks(): void {
    const steps = Math.max(1, this.versions.length - 1);
    const counts = this.versions.map(countOf);
    const most = Math.log1p(Math.max(1, ...counts.slice(1)));
    this.marks.setAttribute("viewBox", `0 0 ${steps} ${HEIGHT}`);
    const bars = document.createElementNS(SVG, "path");
    const bar = (count: number, at: number) => {
      const height = LOWEST + (HEIGHT - LOWEST) * Math.min(1, Math.log1p(count) / most);
      return `M${at} ${HEIGHT}V${HEIGHT - height}`;
    };
    bars.setAttribute("d", counts.map(bar).join(""));
    this.marks.replaceChildren(bars);
  }
}

/** When a version was made; its number where that is not known. */
export function timeOf({ version, time }: Version): string {
  return time === null ? `Version ${version}` : stamp(time).slice(0, 16);
}

/** What a version changed, in words. */
export function changesOf({ changes }: Version): string {
  const parts = Object.entries(changes).map(([kind, count]) => `${count} ${kind}`);
  return parts.join(", ") || "nothing changed";
}

const countOf = ({ changes }: Version): number =>
  Object.values(changes).reduce((sum, count) => sum + count, 0);
