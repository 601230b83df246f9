/** The form of a note: its text, author, links and files. */

import { complain, el, iconButton } from "./dom";
import type { NoteFile } from "./source";

export interface Written {
  text: string;
  author: string;
  links: string[];
  /** Which of the files that the note has stay. */
  kept: NoteFile[];
  /** New files. */
  files: File[];
}

/** `held` are files that the note has, `files` those that were dropped. */
export function noteForm(
  before: { text: string; author: string; links: string[] },
  held: NoteFile[],
  files: File[],
  save: (written: Written) => Promise<void>,
): { form: HTMLFormElement } {
  const text = el("textarea", { id: "note-text", value: before.text, placeholder: "Loose tile" });
  text.rows = 6;
  const author = el("input", { type: "text", id: "note-author", value: before.author });
  const links = el("input", {
    type: "text",
    id: "note-links",
    value: before.links.join(" "),
    placeholder: "https://…",
  });
  const chooser = el("input", { type: "file", id: "note-files" });
  chooser.multiple = true;
  const kept = [...held];
  const added = [...files];
  const list = el("ul", { class: "note-files" });
  const draw = () => list.replaceChildren(...rows(kept, draw), ...rows(added, draw));
  chooser.onchange = () => {
    added.push(...(chooser.files ?? []));
    chooser.value = "";
    draw();
  };
  draw();
  const submit = el("button", { type: "submit", class: "button small primary", text: "Done" });
  const form = el(
    "form",
    { class: "form" },
    ...labeled("note-text", "Text", text),
    ...labeled("note-author", "Author", author),
    ...labeled("note-links", "Links, separated by blanks", links),
    ...labeled("note-files", "Files", chooser),
    list,
    el("div", { class: "buttons" }, submit),
  );
  form.onsubmit = (event) => {
    event.preventDefault();
    submit.disabled = true; // until it is there; a large file takes a while
    const written = {
      text: text.value,
      author: author.value.trim(),
      links: links.value.split(/\s+/).filter(Boolean),
      kept,
      files: added,
    };
    void save(written)
      .catch(complain)
      .finally(() => (submit.disabled = false));
  };
  return { form };
}

/** A row for each file, with a button that takes it away. */
function rows<T extends { name: string }>(files: T[], draw: () => void): HTMLElement[] {
  return files.map((file) => {
    const take = () => {
      files.splice(files.indexOf(file), 1);
      draw();
    };
    return el("li", {}, el("span", { text: file.name }), iconButton("bin", "Remove", take));
  });
}

function labeled(id: string, text: string, field: HTMLElement): HTMLElement[] {
  return [el("label", { for: id, text }), field];
}
