/** Keyboard shortcuts of the whole page. */

export interface Keys {
  escape: () => void;
  search: () => void;
  fit: () => void;
  history: () => void;
  finish: () => void;
  back: () => void;
  remove: () => unknown;
  undo: () => unknown;
  redo: () => unknown;
  save: () => unknown;
  isDrawing: () => boolean;
}

export function watchKeys(keys: Keys): void {
  document.addEventListener("keydown", (event) => {
    const verb = verbOf(event, keys.isDrawing());
    if (!verb || document.querySelector("dialog[open]")) return;
    event.preventDefault();
    keys[verb]();
  });
}

type Verb = Exclude<keyof Keys, "isDrawing">;

export function verbOf(event: KeyboardEvent, drawing: boolean): Verb | null {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const control = event.ctrlKey || event.metaKey;
  if (key === "Escape") return "escape";
  if (control && key === "s") return "save";
  if (isTyping(event.target) || event.altKey) return null;
  if (control) {
    if (key === "z") return event.shiftKey ? "redo" : "undo";
    return key === "y" ? "redo" : null;
  }
  if (drawing && key === "Enter") return "finish";
  if (drawing && key === "Backspace") return "back";
  if (key === "/") return "search";
  if (key === "f") return "fit";
  if (key === "t") return "history";
  return key === "Delete" ? "remove" : null;
}

function isTyping(target: EventTarget | null): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target instanceof HTMLInputElement) return !["checkbox", "range"].includes(target.type);
  return target.matches("textarea, select, [contenteditable]");
}
