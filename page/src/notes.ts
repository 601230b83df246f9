/** Notes at places: marks on the map, their list, and what they say; adding and changing them. */

import Feature from "ol/Feature.js";
import MultiPolygon from "ol/geom/MultiPolygon.js";
import PointGeometry from "ol/geom/Point.js";
import type { Context } from "./ask";
import { byId, choose, complain, el, notify } from "./dom";
import { count } from "./format";
import { fromBase } from "./frames";
import type { MapView } from "./mapview";
import { noteForm, type Written } from "./noteform";
import type { Panel } from "./panel";
import { setFeatures } from "./plane";
import type { Change, DataSource, Editing, MapInfo, Note, NoteFile, Point } from "./source";

/** How far from a mark a click still means it [pixels]. */
const REACH = 14;
/** Name of the layer that the first note makes. */
const NOTES = "notes";

export class Notes {
  /** Whether the next click on the map says where a new note is. */
  active = false;
  private all: Note[] = [];
  private shown: Note | null = null;
  /** Of which version of the layers the notes are. */
  private version = "";
  private loading: Promise<void> = Promise.resolve();
  private author = "";

  constructor(
    private readonly view: MapView,
    private readonly source: DataSource,
    private readonly panel: Panel,
    private readonly context: Context,
    private readonly verbs: {
      hint: (text: string | null) => void;
      changed: (change: Change) => Promise<void>;
      /** Other answers on the map are forgotten. */
      clear: () => void;
      /** The list has changed. */
      listed: () => void;
    },
  ) {
    this.acceptDrops(byId("map"));
  }

  /** Whether notes can be written here. */
  get canWrite(): boolean {
    return this.source.editing !== undefined && this.context.info.editable;
  }

  /** Loads the notes of a map that has changed. */
  setInfo(info: MapInfo): Promise<void> {
    this.loading = this.load(info);
    return this.loading;
  }

  private async load(info: MapInfo): Promise<void> {
    const layers = info.layers.filter(({ kind }) => kind === "notes");
    const version = layers.map(({ name, version }) => `${name} ${version}`).join();
    if (version === this.version) return;
    this.version = version;
    this.all = layers.length ? ((await this.source.notes?.()) ?? []) : [];
    this.draw();
    this.verbs.listed();
    const { shown } = this;
    if (!shown || !byId("panel").querySelector(".note-text")) return;
    const now = this.all.find(({ layer, id }) => layer === shown.layer && id === shown.id);
    if (now) this.show(now);
    else this.panel.close();
  }

  /** The notes of a layer as a list of buttons. */
  list(layer: string): HTMLElement {
    const rows = this.all
      .filter((note) => note.layer === layer)
      .map((note) =>
        el(
          "li",
          {},
          el(
            "button",
            { type: "button", class: "note-row", onclick: () => this.open(note) },
            el("span", { class: "note-number", text: String(note.id) }),
            el("span", { class: "name", text: note.title }),
          ),
        ),
      );
    return el("ul", { class: "note-list" }, ...rows);
  }

  /** The note that is marked at a place, if one is. */
  at([x, y]: Point): Note | null {
    const reach = REACH * this.view.resolution;
    const near = this.all
      .filter(({ layer }) => this.view.isShown(layer))
      .map((note) => ({ note, far: Math.hypot(note.at[0] - x, note.at[1] - y) }))
      .filter(({ far }) => far <= reach);
    near.sort((one, other) => one.far - other.far);
    return near[0]?.note ?? null;
  }

  begin(): void {
    this.active = true;
    this.verbs.hint("Click where the note belongs, or drop a file on the map");
  }

  stop(): void {
    this.active = false;
  }

  /** The panel was closed, or shows something else. */
  letGo(): void {
    if (!this.shown) return;
    this.shown = null;
    this.draw();
  }

  show(note: Note): void {
    this.verbs.clear();
    this.shown = note;
    this.draw();
    this.view.markChosen(note.polygons.length ? note.polygons : null);
    const { frame } = this.context;
    const [x, y] = fromBase(frame, note.at);
    const by = note.author ? `${note.author}, ` : "";
    this.panel.show({
      title: note.title,
      summary: `Note ${note.id}, ${by}${moment(note.time)}, at ${x.toFixed(2)}, ${y.toFixed(2)}`,
      content: [
        textOf(note),
        ...note.files.map(fileOf),
        ...note.links.map(linkOf),
        note.changed ? el("p", { class: "quiet", text: `Changed ${moment(note.changed)}` }) : null,
        this.canWrite ? this.buttons(note) : null,
      ],
    });
  }

  /** Asks for what a new note at a place says. */
  write(point: Point, files: File[] = []): void {
    this.stop();
    this.verbs.clear();
    this.verbs.hint(null);
    this.view.markPlace(point);
    const { form } = noteForm({ text: "", author: this.author, links: [] }, [], files, (written) =>
      this.save(written, { op: "add_note", layer: this.layer(), point }),
    );
    this.panel.show({ title: "New note", summary: "You can use Markdown", content: [form] });
    form.querySelector("textarea")?.focus();
  }

  private change(note: Note): void {
    const { form } = noteForm(note, note.files, [], (written) =>
      this.save(written, { op: "update_note", layer: note.layer, id: note.id }),
    );
    this.panel.show({ title: `Note ${note.id}`, summary: note.title, content: [form] });
  }

  private async save(
    { text, author, links, kept, files }: Written,
    what: { op: "add_note" | "update_note"; layer: string; id?: number; point?: Point },
  ): Promise<void> {
    const editing = this.editing();
    const hashes = kept.map(({ sha256 }) => sha256);
    for (const file of files) hashes.push((await editing.upload(file)).sha256);
    this.author = author;
    const values = { text, author, links, files: hashes };
    const { version } = this.context.info;
    const change = await editing.edit(version, [{ ...what, ...values }]);
    this.panel.close();
    await this.verbs.changed(change);
    await this.loading;
    const id = change.ids?.[0];
    const note = this.all.find((one) => one.layer === what.layer && one.id === id);
    if (note) this.show(note);
  }

  private async remove(note: Note): Promise<void> {
    const answer = await choose("Delete this note?", note.title, [
      { value: "cancel", label: "Cancel" },
      { value: "delete", label: "Delete", look: "danger" },
    ]);
    if (answer !== "delete") return;
    const { version } = this.context.info;
    const { layer, id } = note;
    const change = await this.editing().edit(version, [{ op: "remove_note", layer, id }]);
    this.panel.close();
    await this.verbs.changed(change);
    notify(`Note ${id} was deleted; undo brings it back`);
  }

  private buttons(note: Note): HTMLElement {
    const button = (text: string, look: string, onclick: () => void) =>
      el("button", { type: "button", class: `button small ${look}`, text, onclick });
    return el(
      "div",
      { class: "buttons" },
      button("Edit", "", () => this.change(note)),
      button("Delete", "danger", () => void this.remove(note).catch(complain)),
    );
  }

  private open(note: Note): void {
    this.show(note);
    this.view.reveal(note.at);
  }

  /** To which layer a new note goes. */
  private layer(): string {
    return this.context.info.layers.find(({ kind }) => kind === "notes")?.name ?? NOTES;
  }

  private editing(): Editing {
    const { editing } = this.source;
    if (!editing) throw new Error("this map is read-only");
    return editing;
  }

  private draw(): void {
    for (const [name, { notes }] of this.view.layers) {
      if (!notes) continue;
      const own = this.all.filter(({ layer }) => layer === name);
      const marks = own.map((note) => {
        const mark = featureOf(new PointGeometry(note.at), note.id);
        mark.set("shown", note === this.shown);
        return mark;
      });
      const areas = own
        .filter(({ polygons }) => polygons.length)
        .map(({ polygons }) => featureOf(new MultiPolygon(polygons), null));
      setFeatures(notes, [...areas, ...marks]);
    }
  }

  /** A file that is dropped on the map begins a note there. */
  private acceptDrops(target: HTMLElement): void {
    const carriesFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
    target.addEventListener("dragover", (event) => {
      if (carriesFiles(event)) event.preventDefault();
    });
    target.addEventListener("drop", (event) => {
      if (!carriesFiles(event)) return;
      event.preventDefault(); // or the browser would open the file in place of the page
      if (!this.canWrite) return notify("This map is read-only", "alert");
      const [x, y] = this.view.map.getEventCoordinate(event);
      this.write([x, y], [...(event.dataTransfer?.files ?? [])]);
    });
  }
}

function featureOf(geometry: PointGeometry | MultiPolygon, number: number | null): Feature {
  const feature = new Feature(geometry);
  feature.set("number", number);
  return feature;
}

/** The text; the server has made safe HTML of it, and the page's policy runs no script. */
function textOf({ html }: Note): HTMLElement {
  const text = el("div", { class: "note-text" });
  text.innerHTML = html;
  return text;
}

function fileOf(file: NoteFile): HTMLElement {
  if (!file.is_there || !file.url) {
    const why = file.is_there ? "not in this page" : "missing next to the map";
    return el("p", { class: "quiet", text: `${file.name}: ${why}` });
  }
  const link = el("a", { class: "note-file", text: `${file.name} (${size(file.size)})` });
  link.href = file.url;
  link.target = "_blank";
  link.rel = "noopener";
  return el("figure", { class: "note-figure" }, player(file), el("figcaption", {}, link));
}

/** What shows a file; nothing for one that is for download alone. */
function player({ kind, url, name }: NoteFile): HTMLElement | null {
  if (kind === "picture") return el("img", { src: url, alt: name });
  if (kind !== "sound" && kind !== "video") return null;
  const media = el(kind === "sound" ? "audio" : "video", { src: url, aria: { label: name } });
  media.controls = true;
  media.preload = "metadata";
  return media;
}

function linkOf(address: string): HTMLElement {
  const link = el("a", { text: address });
  link.href = address;
  link.target = "_blank";
  link.rel = "noopener noreferrer";
  return el("p", { class: "note-link" }, link);
}

function size(bytes: number): string {
  return bytes < 1e5
    ? `${(bytes / 1e3).toFixed(1)} kB`
    : `${count(Math.round(bytes / 1e5) / 10)} MB`;
}

/** A time in the zone in which it was written. */
const moment = (time: string): string => time.slice(0, 16).replace("T", " ");
