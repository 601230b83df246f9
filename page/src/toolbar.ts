/** The tools at the top of the map. */

import { byId, el, icon, iconButton, type ICONS } from "./dom";

export type Tool = "point" | "rectangle" | "polygon" | "path" | "cover" | "note";

export interface ToolVerbs {
  menu: () => void;
  choose: (tool: Tool) => void;
  edit: () => void;
  history: () => void;
  fit: () => void;
}

const TOOLS: { tool: Tool; label: string; title: string }[] = [
  { tool: "point", label: "Point", title: "Query a point: click the map" },
  { tool: "rectangle", label: "Rectangle", title: "Query a rectangle: drag it" },
  { tool: "polygon", label: "Polygon", title: "Query an area: click its corners" },
  { tool: "path", label: "Path", title: "Find the shortest path: click its start and its goal" },
  {
    tool: "cover",
    label: "Automap",
    title: "Show what the camera covers of an area: click its corners",
  },
  {
    tool: "note",
    label: "Note",
    title: "Leave a note: click its place, or drop a file on the map",
  },
];

export class Toolbar {
  private readonly tools = new Map<Tool, HTMLButtonElement>();
  private readonly edit: HTMLButtonElement;
  private readonly history: HTMLButtonElement;

  constructor(verbs: ToolVerbs, theme: HTMLElement) {
    const menu = iconButton("menu", "Layers and search", verbs.menu, { id: "menu" });
    for (const { tool, label, title } of TOOLS) {
      this.tools.set(
        tool,
        toolButton(tool, `tool-${tool}`, label, title, () => verbs.choose(tool)),
      );
    }
    this.edit = toolButton("edit", "tool-edit", "Edit", "Edit the map", verbs.edit);
    this.edit.setAttribute("aria-pressed", "false");
    const title = "Show the map as it was (t)";
    this.history = toolButton("clock", "tool-history", "History", title, verbs.history);
    this.showHistory(false);
    this.offerHistory(false);
    byId("toolbar").replaceChildren(
      menu,
      ...this.tools.values(),
      el("span", { class: "divider" }),
      this.edit,
      this.history,
      iconButton("fit", "Show the whole map (f)", verbs.fit, { id: "fit" }),
      theme,
    );
    this.showTool("point");
  }

  offerEdit(offered: boolean): void {
    this.edit.hidden = !offered;
  }

  offer(tool: Tool, offered: boolean): void {
    const button = this.tools.get(tool);
    if (button) button.hidden = !offered;
  }

  offerHistory(offered: boolean): void {
    this.history.hidden = !offered;
  }

  showHistory(open: boolean): void {
    this.history.setAttribute("aria-pressed", String(open));
  }

  showTool(chosen: Tool): void {
    for (const [tool, button] of this.tools) {
      button.setAttribute("aria-pressed", String(tool === chosen));
    }
  }

  showEdit(active: boolean): void {
    this.edit.setAttribute("aria-pressed", String(active));
    this.tools.get("point")?.setAttribute("aria-pressed", String(!active));
  }
}

function toolButton(
  name: keyof typeof ICONS,
  id: string,
  label: string,
  title: string,
  onclick: () => void,
): HTMLButtonElement {
  return el(
    "button",
    { type: "button", id, title, class: "tool", onclick },
    icon(name),
    el("span", { class: "tool-label", text: label }),
  );
}
