/** The fields below that for names: near what, how near, inside what, in which area. */

import type { Sought } from "./ask";
import { byId, el, icon, iconButton } from "./dom";
import type { Kind } from "./drawing";
import type { MapInfo, Ring } from "./source";

export class Conditions {
  private readonly near = textField("near", "here: the marked place");
  private readonly within = el("input", { id: "ask-within", type: "number", placeholder: "any" });
  private readonly inside = textField("inside", "anywhere");
  private readonly names = el("datalist", { id: "ask-names" });
  private readonly area = el("div", { class: "area" });
  private readonly fields: HTMLElement;
  private readonly opener: HTMLButtonElement;
  private ring: Ring | null = null;

  constructor(private readonly draw: (kind: Kind, done: (ring: Ring) => void) => void) {
    Object.assign(this.within, { min: "0", step: "any" });
    this.fields = el(
      "div",
      { id: "ask-fields", hidden: true },
      el("label", { for: "ask-near", text: "Near" }),
      this.near,
      el("label", { for: "ask-within", text: "Within" }),
      el("div", { class: "with-unit" }, this.within, el("span", { class: "quiet", text: "m" })),
      el("label", { for: "ask-inside", text: "Inside" }),
      this.inside,
      el("span", { class: "field-name", text: "Area" }),
      this.area,
      this.names,
      el("button", { type: "submit", id: "ask-find", class: "button small primary", text: "Find" }),
    );
    this.opener = el(
      "button",
      {
        type: "button",
        id: "ask-more",
        class: "opener",
        aria: { expanded: "false", controls: "ask-fields" },
        onclick: () => this.open(this.fields.hidden),
      },
      el("span", { class: "grow quiet", text: "Near, inside, in an area" }),
      icon("chevron"),
    );
    byId("conditions").replaceChildren(this.opener, this.fields);
    this.showArea();
  }

  setInfo({ layers }: MapInfo): void {
    const names = new Set(layers.flatMap(({ classes }) => classes.map(({ name }) => name)));
    this.names.replaceChildren(...[...names].sort().map((value) => el("option", { value })));
  }

  /** The search, from the fields and a name. */
  with(name: string): Sought {
    const within = this.within.valueAsNumber;
    return {
      name: name || null,
      near: this.near.value.trim() || null,
      within: Number.isFinite(within) ? within : null,
      inside: this.inside.value.trim() || null,
      ring: this.ring,
    };
  }

  show({ near, inside }: Sought): void {
    this.near.value = near ?? "";
    this.inside.value = inside ?? "";
  }

  /** Hidden conditions do not apply: closing clears the fields. */
  private open(open: boolean): void {
    this.fields.hidden = !open;
    this.opener.setAttribute("aria-expanded", String(open));
    if (open) return this.near.focus();
    for (const field of [this.near, this.within, this.inside]) field.value = "";
    this.ring = null;
    this.showArea();
  }

  private showArea(): void {
    const drawn = (kind: Kind) => this.draw(kind, (ring) => this.setRing(ring));
    this.area.replaceChildren(
      ...(this.ring
        ? [
            el("span", { class: "grow", text: "the drawn area" }),
            iconButton("close", "Remove the area", () => this.setRing(null), { id: "ask-no-area" }),
          ]
        : [
            iconButton("rectangle", "Draw a rectangle to search in", () => drawn("rectangle"), {
              id: "ask-rectangle",
            }),
            iconButton("polygon", "Draw an area to search in", () => drawn("polygon"), {
              id: "ask-polygon",
            }),
          ]),
    );
  }

  private setRing(ring: Ring | null): void {
    this.ring = ring;
    this.showArea();
  }
}

function textField(key: string, placeholder: string): HTMLInputElement {
  const field = el("input", { id: `ask-${key}`, type: "text", placeholder });
  field.autocomplete = "off";
  field.setAttribute("list", "ask-names");
  return field;
}
