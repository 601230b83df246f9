/** The evidence section of an object's panel: when and how it was seen, and its shape
 * by other methods. */

import { complain, el, icon, iconButton } from "./dom";
import { lookOf } from "./evidencelooks";
import { meters, squareMeters } from "./format";
import { extentOf } from "./geometry";
import type { MapView } from "./mapview";
import { cameraSample, lineSample, looksSample } from "./samples";
import { snippetsContent } from "./panel";
import type { DataSource, Evidence, Extent, ObjectDetails } from "./source";
import { timeline } from "./timeline";
import { areOfSeveralDrives, often, timesInWords } from "./words";

export class EvidenceSection {
  /** The object whose evidence is shown, also while its panel is redrawn. */
  private key: string | null = null;
  private chosen: number | null = null;
  private readonly hidden = new Set<string>();

  constructor(
    private readonly view: MapView,
    private readonly source: DataSource,
  ) {}

  /** Hides everything. */
  close(): void {
    this.key = null;
    this.view.showEvidence(null);
  }

  /** The section for an object; it is open if the evidence of the object was shown already. */
  of(object: ObjectDetails): HTMLElement {
    const key = `${object.layer} ${object.id}`;
    if (this.key !== key) this.close();
    const body = el("div", { class: "evidence-body", hidden: true });
    const opener = el(
      "button",
      { type: "button", class: "opener", aria: { expanded: "false" } },
      el("span", { class: "grow", text: "Evidence" }),
      icon("chevron"),
    );
    const toggle = (open: boolean) => {
      opener.setAttribute("aria-expanded", String(open));
      body.hidden = !open;
      if (!open) {
        this.close();
        this.view.markChosen(object.polygons);
        return;
      }
      if (this.key !== key) this.chosen = null;
      this.key = key;
      void this.fill(body, object, key).catch(complain);
    };
    opener.onclick = () => toggle(body.hidden);
    if (this.key === key) toggle(true);
    return el("section", { class: "evidence" }, opener, body);
  }

  private async fill(body: HTMLElement, object: ObjectDetails, key: string): Promise<void> {
    const evidence = await this.source.evidence(object.layer, object.id);
    if (this.key !== key || !body.isConnected) return;
    const { observations, reason, python, command } = evidence;
    if (observations.length === 0) {
      body.replaceChildren(el("p", { class: "quiet", text: reason ?? "" }));
      return;
    }
    if (this.chosen !== null && this.chosen >= observations.length) this.chosen = null;
    this.view.markChosen(null);
    const draw = () => {
      const { chosen, hidden } = this;
      this.view.showEvidence({ evidence, inMap: object.polygons, chosen, hidden });
    };
    body.replaceChildren(
      el("p", { class: "quiet", text: summary(evidence) }),
      this.looks(evidence, draw),
      this.legend(evidence, object, draw),
      ...(python && command ? [snippetsContent({ python, command })] : []),
    );
    draw();
    body.parentElement?.scrollIntoView({ block: "start" });
    this.view.frame(around(evidence, object));
  }

  /** The observations over time, and the selected one. */
  private looks(evidence: Evidence, draw: () => void): HTMLElement {
    const { observations } = evidence;
    const count = observations.length;
    const lane = timeline(observations, timesOf(evidence), (i) => choose(i));
    const slider = el("input", { type: "range", aria: { label: "Observation" } });
    Object.assign(slider, { min: "0", max: String(count), step: "1" });
    const facts = el("p", { class: "quiet look-facts" });
    const choose = (i: number | null) => {
      this.chosen = i;
      slider.value = String(i === null ? 0 : i + 1);
      lane.choose(i);
      facts.replaceChildren(...factsOf(evidence, i));
      draw();
    };
    const step = (by: number) => {
      const next = (this.chosen ?? -1) + by;
      choose(next < 0 || next >= count ? null : next);
    };
    slider.oninput = () => choose(slider.value === "0" ? null : Number(slider.value) - 1);
    const back = () => (this.chosen === null ? choose(count - 1) : step(-1));
    const stepper = el(
      "div",
      { class: "stepper" },
      iconButton("chevron", "The previous observation", back, { class: "back" }),
      slider,
      iconButton("chevron", "The next observation", () => step(1)),
    );
    const section = el("div", { class: "looks" }, lane.element, stepper, facts);
    slider.value = String(this.chosen === null ? 0 : this.chosen + 1);
    lane.choose(this.chosen);
    facts.replaceChildren(...factsOf(evidence, this.chosen));
    return section;
  }

  /** Switches for what the map shows, which are its legend, too. */
  private legend(evidence: Evidence, object: ObjectDetails, draw: () => void): HTMLElement {
    const row = (key: string, sample: Element, title: string, about: string, ...said: string[]) => {
      const box = el("input", { type: "checkbox" });
      box.checked = !this.hidden.has(key);
      box.onchange = () => {
        if (box.checked) this.hidden.delete(key);
        else this.hidden.add(key);
        draw();
      };
      const texts = said.map((text) => el("span", { class: "quiet", text }));
      const label = el(
        "label",
        { title: about },
        box,
        sample,
        el("span", { text: title }),
        ...texts,
      );
      return el("li", { data: { outline: key } }, label);
    };
    const line = (method: string, ...said: string[]) => {
      const { title, about } = lookOf(method);
      return row(method, lineSample(method), title, about, ...said);
    };
    return el(
      "div",
      {},
      el(
        "ul",
        { class: "outlines parts" },
        row("seen", looksSample(), "Observed shapes", "Stronger for higher detection scores"),
        row("cameras", cameraSample(), "Cameras", "Viewpoints"),
      ),
      el("h3", { text: "Its shape by each method" }),
      el(
        "ul",
        { class: "outlines" },
        line("in_map", squareMeters(object.area), ""),
        ...evidence.fused.map(({ method, area, jaccard }) =>
          line(method, squareMeters(area), overlap(jaccard)),
        ),
      ),
      el("p", { class: "quiet", text: explained(evidence) }),
    );
  }
}

const overlap = (jaccard: number): string =>
  jaccard > 0.9995 ? "the same" : `${Math.min(99, Math.round(100 * jaccard))} % overlap`;

function explained({ fused }: Evidence): string {
  const own = fused.find(({ is_own }) => is_own);
  const made = own ? ` This map was made by: ${lookOf(own.method).title.toLowerCase()}.` : "";
  return `Jaccard index: the area shared with the shape in the map, over the area of both.${made}`;
}

function timesOf({ observations, start = 0 }: Evidence): (stamp: number) => string {
  return timesInWords(start, observations[observations.length - 1].stamp, new Date());
}

function summary(evidence: Evidence): string {
  const { observations, seen, start, first_seen, last_seen } = evidence;
  const kept = observations.length;
  const times =
    seen > kept ? `Seen ${seen} times; the newest ${kept} are saved` : `Seen ${often(kept)}`;
  if (start === undefined || first_seen === null || last_seen === null) return `${times}.`;
  const [first, last] = [first_seen, last_seen].map(timesOf(evidence));
  const whose = areOfSeveralDrives(start, last_seen) ? "" : " of the recording";
  return `${times}, first ${first}, last ${last}${whose}.`;
}

function factsOf(evidence: Evidence, i: number | null): (Node | string)[] {
  const { observations } = evidence;
  const count = observations.length;
  if (i === null) {
    const scores = observations.map(({ score }) => score);
    const mean = scores.reduce((sum, score) => sum + score, 0) / count;
    return [
      el("strong", { text: count === 1 ? "The one observation" : `All ${count} observations` }),
      el("br"),
      `mean score ${mean.toFixed(2)}; select one to see it alone`,
    ];
  }
  const { stamp, score, distance, area } = observations[i];
  return [
    el("strong", { text: `Observation ${i + 1} of ${count}` }),
    ` ${timesOf(evidence)(stamp)}`,
    el("br"),
    `score ${score.toFixed(2)}, from ${meters(distance, 0.1)} m away, ${squareMeters(area)}`,
  ];
}

/** The bounding box of the object and its observations. */
function around({ observations, fused }: Evidence, { polygons }: ObjectDetails): Extent {
  return extentOf([
    ...polygons,
    ...observations.flatMap((one) => one.polygons),
    ...fused.flatMap((one) => one.polygons),
  ]);
}
