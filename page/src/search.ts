/** The field for names, which suggests names of the map. */

import { byId, el } from "./dom";
import { count } from "./format";
import { swatch } from "./layers";
import { bestName, isQuestion, matching } from "./names";
import type { ClassInfo, MapInfo } from "./source";

const MOST = 8;

export class Search {
  private readonly input = byId<HTMLInputElement>("search");
  private readonly list = byId("suggestions");
  private names: ClassInfo[] = [];
  private shown: ClassInfo[] = [];
  private active = -1;

  constructor(private readonly find: () => void) {
    this.input.addEventListener("input", () => this.suggest());
    this.input.addEventListener("focus", () => this.suggest());
    this.input.addEventListener("blur", () => this.hide());
    this.input.addEventListener("keydown", (event) => this.key(event));
  }

  setInfo(info: MapInfo): void {
    const names = new Map<string, ClassInfo>();
    for (const one of info.layers.flatMap(({ classes }) => classes)) {
      const before = names.get(one.name);
      names.set(one.name, { ...one, count: one.count + (before?.count ?? 0) });
    }
    this.names = [...names.values()];
  }

  /** The name that is looked for. */
  get name(): string {
    return this.input.value.trim();
  }

  set name(name: string) {
    this.input.value = name;
  }

  /** Says that the field takes questions, too. */
  offerQuestions(): void {
    this.input.placeholder = "Find, or ask a question";
  }

  /** Whether the text is a question in English. */
  get isQuestion(): boolean {
    return isQuestion(this.names, this.name);
  }

  focus(): void {
    this.input.focus();
    this.input.select();
  }

  private suggest(): void {
    this.shown = matching(this.names, this.input.value).slice(0, MOST);
    this.active = -1;
    this.list.replaceChildren(
      ...this.shown.map((one, i) => {
        const option = el(
          "li",
          { role: "option", id: `suggestion-${i}`, aria: { selected: "false" } },
          swatch(one.color),
          el("span", { class: "name grow", text: one.name }),
          el("span", { class: "quiet", text: count(one.count) }),
        );
        // Before the field loses focus and the list closes.
        option.addEventListener("pointerdown", (event) => {
          event.preventDefault();
          this.choose(one.name);
        });
        return option;
      }),
    );
    this.list.hidden = this.shown.length === 0;
    this.input.setAttribute("aria-expanded", String(!this.list.hidden));
    this.input.removeAttribute("aria-activedescendant");
  }

  private hide(): void {
    this.list.hidden = true;
    this.input.setAttribute("aria-expanded", "false");
  }

  private key(event: KeyboardEvent): void {
    if (event.key === "ArrowDown" || event.key === "ArrowUp") {
      event.preventDefault();
      this.move(event.key === "ArrowDown" ? 1 : -1);
    } else if (event.key === "Enter") {
      event.preventDefault(); // the form would ask once more
      const text = this.input.value.trim();
      this.choose(
        this.shown[this.active]?.name ?? (this.isQuestion ? text : bestName(this.names, text)),
      );
    } else if (event.key === "Escape") {
      event.stopPropagation();
      this.input.blur();
    }
  }

  private move(by: number): void {
    if (this.list.hidden) this.suggest();
    if (!this.shown.length) return;
    this.active = (this.active + by + this.shown.length) % this.shown.length;
    [...this.list.children].forEach((option, i) => {
      option.setAttribute("aria-selected", String(i === this.active));
      if (i === this.active) option.scrollIntoView({ block: "nearest" });
    });
    this.input.setAttribute("aria-activedescendant", `suggestion-${this.active}`);
  }

  private choose(name: string): void {
    this.input.value = name;
    this.hide();
    this.find();
  }
}
