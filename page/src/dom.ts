/** Elements of the page. Text from the map enters as text and never as markup. */

type Child = Node | string | null | undefined | false;

export type Attributes = {
  class?: string;
  text?: string;
  title?: string;
  type?: string;
  id?: string;
  value?: string;
  src?: string;
  alt?: string;
  placeholder?: string;
  hidden?: boolean;
  disabled?: boolean;
  onclick?: (event: MouseEvent) => void;
  oninput?: (event: Event) => void;
  onchange?: (event: Event) => void;
  onfocus?: () => void;
  onblur?: () => void;
  aria?: Record<string, string>;
  data?: Record<string, string>;
  role?: string;
  for?: string;
};

export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  const { class: className, text, aria, data, role, for: target, ...rest } = attributes;
  if (className) element.className = className;
  if (text !== undefined) element.textContent = text;
  if (role) element.setAttribute("role", role);
  if (target) element.setAttribute("for", target);
  for (const [key, value] of Object.entries(aria ?? {})) element.setAttribute(`aria-${key}`, value);
  for (const [key, value] of Object.entries(data ?? {})) element.dataset[key] = value;
  Object.assign(element, rest);
  element.append(...children.filter((child): child is Node | string => !!child));
  return element;
}

/** The element of index.html with this id. */
export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no element "${id}"`);
  return element as T;
}

const SVG = "http://www.w3.org/2000/svg";

/** A line icon of 20 x 20 from the path data of its strokes. */
export function icon(name: keyof typeof ICONS): SVGSVGElement {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 20 20");
  svg.setAttribute("aria-hidden", "true");
  svg.classList.add("icon");
  const path = document.createElementNS(SVG, "path");
  path.setAttribute("d", ICONS[name]);
  svg.append(path);
  return svg;
}

export const ICONS = {
  menu: "M3 5.5h14M3 10h14M3 14.5h14",
  close: "M5 5l10 10M15 5L5 15",
  fit: "M3 7V3h4M13 3h4v4M17 13v4h-4M7 17H3v-4",
  point:
    "M10 18s-5.5-5.2-5.5-9.2a5.5 5.5 0 0 1 11 0C15.500 12.800 10 18 10 18zM10 10.500a1.700 1.700 0 1 0 0-3.400a1.700 1.700 0 0 0 0 3.400z",
  rectangle: "M3.5 5.500h13v9h-13z",
  polygon: "M4 7.500L11 3l6 5-2.500 8.500-9-1z",
  path: "M5 15.500a1.500 1.500 0 1 0 0-3a1.500 1.500 0 0 0 0 3zM5 12.500V6.500a2.500 2.500 0 0 1 5 0v7a2.500 2.500 0 0 0 5 0V7.500M15 7.500a1.500 1.500 0 1 0 0-3a1.500 1.500 0 0 0 0 3z",
  cover: "M3.500 3.500h13v13h-13zM3.500 9.500h7v-6M6 6.500h2",
  note: "M4 3.500h12v9l-4 4H4zM12 16.500v-4h4M7 7h6M7 10h4",
  edit: "M4 16l.8-3.600L13.200 4a1.400 1.400 0 0 1 2 0l.8.8a1.400 1.400 0 0 1 0 2L7.600 15.200z",
  undo: "M7 4L3.500 7.500 7 11M4 7.500h8a4.250 4.250 0 0 1 0 8.500H8",
  redo: "M13 4l3.500 3.500L13 11M16 7.500H8a4.250 4.250 0 0 0 0 8.500h4",
  save: "M4 3.500h9.500L16.500 6.500v10h-13v-13zM7 3.500v4h5.500v-4M6.500 16.500v-5h7v5",
  saveAs:
    "M8 16.500H3.500v-13H13l3.500 3.500v2M7 3.500v4h5.500v-4M11 16.500l.500-2.500 4-4 2 2-4 4z",
  sun: "M10 13.500a3.500 3.500 0 1 0 0-7a3.500 3.500 0 0 0 0 7zM10 2v1.800M10 16.200V18M2 10h1.800M16.200 10H18M4.300 4.300l1.300 1.300M14.400 14.400l1.300 1.300M4.300 15.700l1.300-1.300M14.400 5.600l1.300-1.300",
  moon: "M16.500 11.800A7 7 0 0 1 8.200 3.500a7 7 0 1 0 8.300 8.300z",
  settings: "M3 6h7M14 6h3M3 14h3M10 14h7M12 4v4M8 12v4",
  copy: "M7 7h9.500v9.500H7zM4.500 13H3.500V3.500H13v1",
  check: "M4 10.500l4 4 8-9",
  search: "M9 14.500a5.500 5.500 0 1 0 0-11a5.500 5.500 0 0 0 0 11zM13 13l4 4",
  bin: "M4 6h12M8 6V4h4v2M5.500 6l.7 10.500h7.600L14.500 6",
  room: "M3.500 16.500v-13h13v13h-5M3.500 16.500h4M7.500 16.500v-5",
  plus: "M10 4v12M4 10h12",
  chevron: "M7 5l5 5-5 5",
  play: "M6.500 4l9 6-9 6z",
  pause: "M7 4.500v11M13 4.500v11",
  clock: "M10 17a7 7 0 1 0 0-14a7 7 0 0 0 0 14zM10 6v4.200l2.800 1.800",
  back: "M14 4.500v11L7 10zM5.500 4.500v11",
  forth: "M6 4.500v11l7-5.500zM14.500 4.500v11",
  frame: "M4 16V5M4 16h11M2.500 6.500L4 4.500l1.500 2M13.500 14.500l2 1.500-2 1.500",
} as const;

export function iconButton(
  name: keyof typeof ICONS,
  label: string,
  onclick: () => void,
  attributes: Attributes = {},
): HTMLButtonElement {
  const { class: className, ...rest } = attributes;
  return el(
    "button",
    {
      type: "button",
      title: label,
      aria: { label },
      onclick,
      class: `icon-button ${className ?? ""}`.trim(),
      ...rest,
    },
    icon(name),
  );
}

/** Asks with a dialog; resolves to the chosen value, or null for Esc. */
export function choose<T extends string>(
  title: string,
  text: string,
  choices: { value: T; label: string; look?: "primary" | "danger" }[],
): Promise<T | null> {
  return new Promise((resolve) => {
    const buttons = choices.map(({ value, label, look }) =>
      el("button", { type: "submit", value, text: label, class: `button ${look ?? ""}` }),
    );
    const dialog = el(
      "dialog",
      { class: "dialog", aria: { labelledby: "dialog-title" } },
      el(
        "form",
        {},
        el("h2", { id: "dialog-title", text: title }),
        el("p", { text }),
        el("div", { class: "dialog-buttons" }, ...buttons),
      ),
    );
    dialog.querySelector("form")?.setAttribute("method", "dialog");
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve((dialog.returnValue || null) as T | null);
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}

/** Asks for a name with a dialog; null if there is none. */
export function askName(
  title: string,
  text: string,
  value: string,
  label: string,
): Promise<string | null> {
  return new Promise((resolve) => {
    const input = el("input", { type: "text", value, aria: { label: title } });
    input.required = true;
    input.pattern = ".*\\S.*";
    input.autocomplete = "off";
    const form = el(
      "form",
      { class: "form" },
      el("h2", { id: "dialog-title", text: title }),
      el("p", { text }),
      input,
      el(
        "div",
        { class: "dialog-buttons" },
        el("button", {
          type: "button",
          text: "Cancel",
          class: "button",
          onclick: () => dialog.close(),
        }),
        el("button", { type: "submit", value: "ok", text: label, class: "button primary" }),
      ),
    );
    form.setAttribute("method", "dialog");
    const dialog = el("dialog", { class: "dialog", aria: { labelledby: "dialog-title" } }, form);
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(dialog.returnValue === "ok" ? input.value.trim() : null);
    });
    document.body.append(dialog);
    dialog.showModal();
    input.select();
  });
}

/** Shows a message that disappears after a while; `alert` for errors. */
export function notify(text: string, kind: "status" | "alert" = "status"): void {
  const list = byId("notices");
  const close = () => notice.remove();
  const notice = el(
    "div",
    { class: `notice ${kind}`, role: kind },
    el("span", { text }),
    iconButton("close", "Dismiss", close),
  );
  list.append(notice);
  while (list.children.length > 3) list.firstElementChild?.remove();
  window.setTimeout(close, kind === "alert" ? 12000 : 4000);
}

/** Shows why a query failed; a canceled query is not an error. */
export function complain(error: unknown): void {
  if (error instanceof DOMException && error.name === "AbortError") return;
  notify(error instanceof Error ? error.message : String(error), "alert");
}

export async function copyText(text: string, button: HTMLButtonElement): Promise<void> {
  await navigator.clipboard.writeText(text).catch(() => copyBySelection(text));
  const before = [...button.childNodes];
  button.replaceChildren(icon("check"), " Copied");
  window.setTimeout(() => button.replaceChildren(...before), 1500);
}

/** A page opened from a file has no clipboard API. */
function copyBySelection(text: string): void {
  const area = el("textarea", { value: text, class: "off-screen" });
  document.body.append(area);
  area.select();
  document.execCommand("copy");
  area.remove();
}

/** Lets the browser download a file. */
export function saveFile(name: string, content: Blob): void {
  const url = URL.createObjectURL(content);
  const link = el("a", {});
  link.href = url;
  link.download = name;
  link.click();
  window.setTimeout(() => URL.revokeObjectURL(url), 10000);
}
