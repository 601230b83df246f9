/** The bar of edit mode. */

import { byId, el, icon, type ICONS } from "./dom";
import type { Kind } from "./drawing";
import { ROOMS } from "./looks";
import type { MapInfo } from "./source";

export interface EditVerbs {
  draw: (kind: Kind, room: boolean) => void;
  findRooms: () => void;
  undo: () => void;
  redo: () => void;
  save: () => void;
  saveAs: () => void;
  done: () => void;
}

export class EditBar {
  private readonly findRooms: HTMLButtonElement;
  private readonly undo: HTMLButtonElement;
  private readonly redo: HTMLButtonElement;
  private readonly save: HTMLButtonElement;

  constructor(verbs: EditVerbs) {
    this.findRooms = button(
      "search",
      "edit-find-rooms",
      "Find rooms",
      "Find rooms and doors in the grid",
      verbs.findRooms,
    );
    this.undo = button("undo", "edit-undo", "Undo", "Undo (Ctrl+Z)", verbs.undo);
    this.redo = button("redo", "edit-redo", "Redo", "Redo (Ctrl+Y)", verbs.redo);
    this.save = button("save", "edit-save", "Save", "Save the map (Ctrl+S)", verbs.save);
    this.save.classList.add("primary");
    byId("editbar").replaceChildren(
      button("rectangle", "edit-rectangle", "Rectangle", "Add an object: a rectangle", () =>
        verbs.draw("rectangle", false),
      ),
      button("polygon", "edit-polygon", "Polygon", "Add an object: any shape", () =>
        verbs.draw("polygon", false),
      ),
      button("room", "edit-room", "Room", "Add a room or a zone", () =>
        verbs.draw("polygon", true),
      ),
      this.findRooms,
      el("span", { class: "divider" }),
      this.undo,
      this.redo,
      this.save,
      button("saveAs", "edit-save-as", "Save as", "Save the map with another name", verbs.saveAs),
      el("span", { class: "divider" }),
      button("check", "edit-done", "Done", "Leave edit mode (Esc)", verbs.done),
    );
  }

  update({ can_undo, can_redo, unsaved, layers }: MapInfo): void {
    const hasGrid = layers.some(({ class_name }) => class_name === "OccupancyGridLayer");
    const hasRooms = layers.some(({ name, count }) => name === ROOMS && count > 0);
    this.findRooms.hidden = hasRooms || !hasGrid;
    this.undo.disabled = !can_undo;
    this.redo.disabled = !can_redo;
    this.save.disabled = !unsaved;
  }
}

function button(
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
