/** The forms of edit mode: an object's name and tags. */

import { el } from "./dom";
import type { ObjectDetails } from "./source";

export interface Named {
  name: string;
  tags: string[];
}

/** A new object, and where it goes. */
export interface Placed extends Named {
  layer: string;
  /** Whether there is no such layer yet. */
  isNewLayer: boolean;
}

/** The option for a new layer; no layer has this name. */
const NEW_LAYER = "";

export const tagsFrom = (text: string): string[] => [
  ...new Set(
    text
      .split(",")
      .map((tag) => tag.trim())
      .filter(Boolean),
  ),
];

export function objectForm(
  object: ObjectDetails,
  names: string[],
  verbs: {
    change: (values: Partial<Named>) => void;
    duplicate: () => void;
    merge: () => void;
    /** Of rooms only. */
    split?: () => void;
    remove: () => void;
  },
): HTMLElement {
  const { name, tags } = fields(names, object.name, object.tags);
  const form = el(
    "form",
    { class: "form" },
    ...name.rows,
    ...tags.rows,
    reshaping(),
    el(
      "div",
      { class: "buttons" },
      el("button", {
        type: "button",
        class: "button small",
        text: "Duplicate",
        onclick: verbs.duplicate,
      }),
      el("button", {
        type: "button",
        class: "button small",
        text: "Merge with…",
        onclick: verbs.merge,
      }),
      verbs.split &&
        el("button", {
          type: "button",
          class: "button small",
          text: "Split…",
          title: "Split it into two rooms, along a line that you draw",
          onclick: verbs.split,
        }),
    ),
    el(
      "div",
      { class: "buttons" },
      el("button", {
        type: "button",
        class: "button danger",
        text: "Delete",
        onclick: verbs.remove,
      }),
      el("span", { class: "grow" }),
      el("button", { type: "submit", class: "button primary", text: "Apply", id: "object-apply" }),
    ),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const values: Partial<Named> = {};
    const newTags = tagsFrom(tags.input.value);
    if (name.input.value.trim() !== object.name) values.name = name.input.value.trim();
    if (newTags.join() !== object.tags.join()) values.tags = newTags;
    if (Object.keys(values).length) verbs.change(values);
  });
  return form;
}

export function newObjectForm(
  names: string[],
  layers: string[],
  room: boolean,
  taken: string[],
  verbs: { add: (values: Placed) => Promise<boolean>; cancel: () => void },
): HTMLElement {
  const { name, tags } = fields(names, "", room ? ["room"] : []);
  const layer = el(
    "select",
    { id: "object-layer" },
    ...layers.map((layer) => el("option", { value: layer, text: layer })),
    el("option", { value: NEW_LAYER, text: "New layer…" }),
  );
  layer.value = layers.find((name) => room === (name === "rooms")) ?? layers[0] ?? NEW_LAYER;
  const newLayer = el("input", {
    id: "object-new-layer",
    type: "text",
    placeholder: "layer name, such as zones",
    aria: { label: "Name of the new layer" },
  });
  newLayer.autocomplete = "off";
  newLayer.pattern = ".*\\S.*";
  const offerName = () => {
    newLayer.hidden = layer.value !== NEW_LAYER;
    newLayer.required = !newLayer.hidden;
  };
  const checkName = () => {
    const name = newLayer.value.trim();
    const other = taken.includes(name) && !layers.includes(name);
    newLayer.setCustomValidity(other ? `Layer ${name} has no objects; choose another name` : "");
  };
  newLayer.addEventListener("input", checkName);
  layer.addEventListener("change", () => {
    offerName();
    if (!newLayer.hidden) newLayer.focus();
  });
  offerName();
  const add = el("button", {
    type: "submit",
    class: "button primary",
    text: "Add",
    id: "object-add",
  });
  const form = el(
    "form",
    { class: "form" },
    ...name.rows,
    el("label", { text: "Layer", for: "object-layer" }),
    layer,
    newLayer,
    ...tags.rows,
    reshaping(),
    el(
      "div",
      { class: "buttons" },
      el("button", { type: "button", class: "button", text: "Cancel", onclick: verbs.cancel }),
      el("span", { class: "grow" }),
      add,
    ),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const chosen = layer.value === NEW_LAYER ? newLayer.value.trim() : layer.value;
    const values = {
      name: name.input.value.trim(),
      layer: chosen,
      isNewLayer: !layers.includes(chosen),
      tags: tagsFrom(tags.input.value),
    };
    add.disabled = true; // once is enough, unless it is refused
    void verbs.add(values).then((added) => (add.disabled = added));
  });
  return form;
}

function reshaping(): HTMLElement {
  return el("p", {
    class: "quiet",
    text:
      "On the map, drag a corner or an edge to reshape it, its middle to move it, and the handle " +
      "above it to turn it (with Shift by 15°). Alt+click removes a corner.",
  });
}

interface Field {
  input: HTMLInputElement;
  rows: HTMLElement[];
}

function fields(names: string[], name: string, tags: string[]): { name: Field; tags: Field } {
  const nameInput = el("input", { id: "object-name", type: "text", value: name });
  nameInput.required = true;
  nameInput.pattern = ".*\\S.*";
  nameInput.autocomplete = "off";
  nameInput.setAttribute("list", "object-names");
  const list = el(
    "datalist",
    { id: "object-names" },
    ...names.map((name) => el("option", { value: name })),
  );
  const tagsInput = el("input", {
    id: "object-tags",
    type: "text",
    value: tags.join(", "),
    placeholder: "separated by commas",
  });
  tagsInput.autocomplete = "off";
  return {
    name: {
      input: nameInput,
      rows: [el("label", { text: "Name", for: "object-name" }), nameInput, list],
    },
    tags: {
      input: tagsInput,
      rows: [el("label", { text: "Tags", for: "object-tags" }), tagsInput],
    },
  };
}
