/** The side panel: one answer at a time, and the same query as code. */

import { byId, copyText, el, icon, iconButton } from "./dom";
import type { Snippets } from "./source";

export interface Answer {
  title: string;
  /** One line, which screen readers announce. */
  summary: string;
  content: (Node | null)[];
  snippets?: Snippets;
}

/** The language that was selected last. */
let chosenLanguage: keyof Snippets = "python";

export class Panel {
  private readonly element = byId("panel");

  /** The match that had the keyboard focus last. */
  private hit = "";

  constructor(
    private readonly opened: () => void,
    private readonly closed: () => void,
  ) {}

  get isOpen(): boolean {
    return !this.element.hidden;
  }

  show({ title, summary, content, snippets }: Answer): void {
    const hadFocus = this.element.contains(document.activeElement);
    this.rememberHit();
    this.element.replaceChildren(
      el(
        "header",
        { class: "head" },
        el(
          "div",
          { class: "grow" },
          el("h2", { text: title }),
          el("p", { class: "quiet", text: summary }),
        ),
        iconButton("close", "Close (Esc)", () => this.close()),
      ),
      el(
        "div",
        { class: "panel-scroll" },
        ...content.filter((node) => node !== null),
        snippets ? snippetsContent(snippets) : null,
      ),
    );
    const wasClosed = this.element.hidden;
    this.element.hidden = false;
    byId("announce").textContent = `${title}. ${summary}`;
    if (hadFocus) this.focus();
    if (wasClosed) this.opened();
  }

  /** Takes the keyboard focus: to the match that was viewed last, or the first one. */
  focus(): void {
    const hits = [...this.element.querySelectorAll<HTMLElement>("ol.found button")];
    const before = hits.find((hit) => keyOf(hit) === this.hit);
    const back = this.element.querySelector<HTMLElement>("[data-back]");
    (before ?? hits[0] ?? back ?? this.element).focus();
  }

  private rememberHit(): void {
    const hit = document.activeElement;
    if (hit instanceof HTMLElement && hit.closest("ol.found")) this.hit = keyOf(hit);
  }

  close(): void {
    if (this.element.hidden) return;
    this.element.hidden = true;
    this.element.replaceChildren();
    this.closed();
  }
}

const keyOf = ({ dataset }: HTMLElement): string => `${dataset["layer"]} ${dataset["id"]}`;

/** The same query as code. */
export function snippetsContent(snippets: Snippets): HTMLElement {
  const code = el("code");
  const names: [keyof Snippets, string][] = [
    ["python", "Python"],
    ["command", "Command line"],
  ];
  const offered = names.filter(([language]) => snippets[language] !== undefined);
  const tabs = offered.map(([language, label]) =>
    el("button", {
      type: "button",
      role: "tab",
      text: label,
      data: { language },
      onclick: () => {
        chosenLanguage = language;
        show(language);
      },
    }),
  );
  const copy = el("button", { type: "button", class: "button small" }, icon("copy"), " Copy");
  copy.onclick = () => void copyText(code.textContent ?? "", copy);
  const show = (language: keyof Snippets) => {
    code.textContent = snippets[language] ?? "";
    code.className = language;
    for (const tab of tabs) {
      tab.setAttribute("aria-selected", String(tab.dataset["language"] === language));
    }
  };
  show(snippets[chosenLanguage] === undefined ? "python" : chosenLanguage);
  const block = el(
    "pre",
    { role: "group", aria: { label: "The same query from a program" } },
    code,
  );
  block.tabIndex = 0;
  return el(
    "section",
    { class: "snippets" },
    el("h3", { text: "The same query from a program" }),
    el("div", { class: "tabs" }, el("div", { class: "tab-list", role: "tablist" }, ...tabs), copy),
    block,
  );
}
