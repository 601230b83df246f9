/** The timeline at the bottom of the page: steps back and forth, or plays. */

import { byId, el, icon, iconButton } from "../dom";
import { stamp } from "../format";
import { cssColor } from "../settings";
import { withAlpha } from "../looks";
import { advanced, type Steps } from "./steps";

export interface TimelineVerbs {
  /** Shows the step at a position. */
  show: (position: number) => void;
}

const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 20];

export class Timeline {
  /** Whether the newest step is shown whenever there is a new one. */
  isLive = true;
  private position = 0;
  private playing = 0;
  private speed = 1;
  private isMapping = true;
  private readonly slider: HTMLInputElement;
  private readonly chart = el("canvas", { class: "chart", aria: { hidden: "true" } });
  private readonly play: HTMLButtonElement;
  private readonly live: HTMLButtonElement;
  private readonly time = el("output", { id: "time", aria: { live: "off" } });

  constructor(
    private readonly steps: Steps,
    private readonly verbs: TimelineVerbs,
  ) {
    this.slider = el("input", {
      type: "range",
      id: "slider",
      value: "0",
      aria: { label: "Step" },
      oninput: () => this.go(Number(this.slider.value)),
    });
    this.slider.min = this.slider.max = "0";
    this.play = iconButton("play", "Play (space)", () => this.toggle(), { id: "play" });
    this.live = el(
      "button",
      { type: "button", id: "live", class: "tool", onclick: () => this.follow() },
      el("span", { class: "live-dot" }),
      el("span", { class: "live-text", text: "Live" }),
    );
    byId("timeline").replaceChildren(
      iconButton("back", "Step back (←)", () => this.by(-1), { id: "back" }),
      this.play,
      iconButton("forth", "Step forward (→)", () => this.by(1), { id: "forth" }),
      el("div", { class: "track" }, this.chart, this.slider),
      this.time,
      this.speeds(),
      this.live,
    );
    new ResizeObserver(() => this.drawChart()).observe(this.chart);
    document.addEventListener("keydown", (event) => this.onKey(event));
  }

  /** Updates to added or removed steps; the shown one now has this position. */
  update(position: number, isMapping: boolean): void {
    this.isMapping = isMapping;
    this.slider.max = String(Math.max(0, this.steps.length - 1));
    const text = this.live.querySelector(".live-text");
    if (text) text.textContent = isMapping ? "Live" : "End";
    this.live.title = isMapping ? "Follow the newest frame (End)" : "Show the last frame (End)";
    this.show(this.isLive ? this.steps.length - 1 : position);
    this.drawChart();
  }

  restyle(): void {
    this.drawChart();
  }

  /** Shows the newest step, and follows new ones. */
  follow(): void {
    this.pause();
    this.isLive = true;
    this.verbs.show(this.steps.length - 1);
    this.show(this.steps.length - 1);
  }

  private go(position: number): void {
    this.pause();
    this.leaveTo(position);
  }

  private by(step: number): void {
    this.go(Math.max(0, Math.min(this.steps.length - 1, this.position + step)));
  }

  /** Shows a step and stays there; at the last step, following starts again. */
  private leaveTo(position: number): void {
    this.isLive = position >= this.steps.length - 1;
    this.verbs.show(position);
    this.show(position);
  }

  private toggle(): void {
    if (this.playing) return this.pause();
    if (this.position >= this.steps.length - 1) this.leaveTo(0);
    this.isLive = false;
    let [before, left] = [performance.now(), 0];
    const step = (now: number) => {
      const time = left + ((now - before) / 1000) * this.speed;
      before = now;
      const next = advanced(this.steps.stamps, this.position, time);
      left = next.left;
      if (next.position !== this.position) {
        this.verbs.show(next.position);
        this.show(next.position);
      }
      if (this.position < this.steps.length - 1) {
        this.playing = requestAnimationFrame(step);
      } else if (this.isMapping) this.follow();
      else {
        this.isLive = true;
        this.pause();
      }
    };
    this.playing = requestAnimationFrame(step);
    this.showPlay();
  }

  private pause(): void {
    cancelAnimationFrame(this.playing);
    this.playing = 0;
    this.showPlay();
  }

  private showPlay(): void {
    const label = this.playing ? "Pause (space)" : "Play (space)";
    this.play.replaceChildren(icon(this.playing ? "pause" : "play"));
    this.play.title = label;
    this.play.setAttribute("aria-label", label);
    this.live.setAttribute("aria-pressed", String(this.isLive));
  }

  private show(position: number): void {
    this.position = Math.max(0, position);
    this.slider.value = String(this.position);
    const [now, all] = [this.position, this.steps.length - 1].map((p) => this.steps.secondsAt(p));
    this.time.replaceChildren(
      el("b", { text: `${now.toFixed(1)} s` }),
      ` / ${Math.max(0, all).toFixed(1)} s`,
    );
    this.time.title = stamp(this.steps.stamps[this.position] ?? null);
    this.slider.setAttribute("aria-valuetext", `${now.toFixed(1)} seconds`);
    this.live.setAttribute("aria-pressed", String(this.isLive));
  }

  private speeds(): HTMLSelectElement {
    const options = SPEEDS.map((speed) =>
      el("option", { value: String(speed), text: `${speed}×` }),
    );
    const select = el(
      "select",
      { id: "speed", title: "Speed", aria: { label: "Speed" } },
      ...options,
    );
    select.value = String(this.speed);
    select.addEventListener("change", () => (this.speed = Number(select.value)));
    return select;
  }

  private onKey(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target instanceof HTMLSelectElement) return;
    const verb = VERBS[event.key];
    // A focused button is pressed by the space bar.
    if (!verb || (event.key === " " && event.target instanceof HTMLButtonElement)) return;
    event.preventDefault();
    if (verb === "back") this.by(-1);
    else if (verb === "forth") this.by(1);
    else if (verb === "first") this.go(0);
    else if (verb === "last") this.follow();
    else this.toggle();
  }

  /** How the map grew: its objects over the steps, behind the slider. */
  private drawChart(): void {
    const { clientWidth: width, clientHeight: height } = this.chart;
    const context = this.chart.getContext("2d");
    const { objects } = this.steps;
    if (!context || !width || !height) return;
    const ratio = window.devicePixelRatio;
    this.chart.width = width * ratio;
    this.chart.height = height * ratio;
    if (objects.length < 2) return;
    context.scale(ratio, ratio);
    const most = objects.reduce((a, b) => Math.max(a, b), 1);
    const accent = cssColor("--accent");
    const line = new Path2D();
    objects.forEach((count, i) => {
      const x = (i / (objects.length - 1)) * width;
      line.lineTo(x, height - 1 - (count / most) * (height - 3));
    });
    const area = new Path2D(line);
    area.lineTo(width, height);
    area.lineTo(0, height);
    context.fillStyle = withAlpha(accent, 0.16);
    context.fill(area);
    context.strokeStyle = withAlpha(accent, 0.5);
    context.stroke(line);
  }
}

const VERBS: Record<string, "back" | "forth" | "first" | "last" | "play"> = {
  ArrowLeft: "back",
  ArrowDown: "back",
  ArrowRight: "forth",
  ArrowUp: "forth",
  Home: "first",
  End: "last",
  " ": "play",
};
