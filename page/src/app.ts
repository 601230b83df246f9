/** The page: joins the map, the panels and the questions. */

import { Ask, type Context } from "./ask";
import { Conditions } from "./conditions";
import { byId, choose, complain, el, notify } from "./dom";
import { Drawing, type Kind } from "./drawing";
import { Editor } from "./edit";
import { count, plural } from "./format";
import { watchKeys } from "./keys";
import { LayersPanel } from "./layers";
import { insets, NARROW, toggleSidebar } from "./layout";
import { ROOMS } from "./looks";
import { drawnLayer, isVisible, MapView } from "./mapview";
import { Notes } from "./notes";
import { Panel } from "./panel";
import { watchPrinting } from "./paper";
import { PathTool } from "./pathtool";
import { placeFromHash, placeToHash } from "./place";
import { Search } from "./search";
import { loadSettings } from "./settings";
import { settingsPanel } from "./settingspanel";
import type { Change, DataSource, Frame, MapInfo, Point, Ring } from "./source";
import { StatusLine } from "./statusline";
import { ThemeSwitch } from "./theme";
import { TimeTravel } from "./timetravel";
import { Toolbar, type Tool } from "./toolbar";
import { ValuesCard } from "./valuescard";

export class App {
  readonly view: MapView;
  private readonly settings = loadSettings();
  private readonly theme = new ThemeSwitch(this.settings, () => this.restyle());
  private readonly context: Context;
  private readonly panel: Panel;
  private readonly ask: Ask;
  private readonly drawing: Drawing;
  private readonly paths: PathTool;
  private readonly search: Search;
  private readonly conditions: Conditions;
  private readonly layers: LayersPanel;
  private readonly notes: Notes;
  private readonly status: StatusLine;
  private readonly values: ValuesCard;
  private readonly toolbar: Toolbar;
  private readonly editor: Editor | null;
  private readonly travel: TimeTravel | null;
  private hashTimer = 0;
  /** Whether the last query was typed: Esc then returns to its field. */
  private isSearching = false;
  /** Reloads are sequential, so that an older answer never replaces a newer one. */
  private reloading: Promise<void> = Promise.resolve();

  constructor(
    private readonly source: DataSource,
    info: MapInfo,
  ) {
    this.context = { info, frame: baseFrame(info) };
    this.view = new MapView(byId("map"), source, insets, () => this.tellCounts());
    this.panel = new Panel(
      () => this.view.makeRoom(),
      () => this.panelClosed(),
    );
    this.ask = new Ask(this.view, source, this.panel, this.context);
    this.drawing = new Drawing(this.view.map);
    this.paths = new PathTool({
      mark: (start) => {
        this.panel.close();
        this.ask.forget();
        this.view.markPlace(start);
      },
      find: (start, goal) => this.ask.path(start, goal),
      hint: (text) => this.hint(text),
    });
    this.search = new Search(() => this.find());
    this.conditions = new Conditions((kind, done) => this.drawToFind(kind, done));
    this.ask.sought = (sought) => {
      this.search.name = sought.name ?? "";
      this.conditions.show(sought);
    };
    this.notes = new Notes(this.view, source, this.panel, this.context, {
      hint: (text) => this.hint(text),
      changed: (change) => this.onChange(change),
      clear: () => this.ask.forget(),
      listed: () => this.layers.draw(),
    });
    this.layers = new LayersPanel(
      this.view,
      () => {
        this.values.draw();
        this.linkPlace();
      },
      (layer) => this.notes.list(layer),
    );
    this.values = new ValuesCard(this.view, source, () => {
      this.layers.draw();
      this.values.draw();
      this.linkPlace();
    });
    this.status = new StatusLine((frame) => this.setFrame(frame));
    this.toolbar = new Toolbar(
      {
        menu: () => toggleSidebar(),
        choose: (tool) => this.choose(tool),
        edit: () => this.toggleEdit(),
        history: () => this.toggleHistory(),
        fit: () => this.view.fit(this.context.info.extent),
      },
      this.theme.button,
    );
    this.editor = this.makeEditor();
    this.travel = this.makeTravel();
  }

  start(): void {
    const { info } = this.context;
    this.show(info);
    this.theme.apply();
    settingsPanel(this.settings, () => this.theme.apply());
    this.restorePlace();
    this.listen();
    watchPrinting(this.view, insets, (draw) => this.theme.inLight(draw));
    void this.loadTimeline().catch(complain);
    this.source.editing?.watch((change) => this.onEvent(change));
    for (const note of info.notes ?? []) notify(note);
    this.hint(info.layers.length ? "Click the map to query a point" : "This map is empty");
  }

  private makeEditor(): Editor | null {
    const { editing } = this.source;
    if (!editing || !this.context.info.editable) return null;
    const editor = new Editor(
      this.view,
      this.source,
      editing,
      this.panel,
      this.ask,
      this.drawing,
      this.context,
      (text) => this.hint(text),
      (change) => this.onChange(change),
    );
    editor.toggled = (active) => this.toolbar.showEdit(active);
    return editor;
  }

  private makeTravel(): TimeTravel | null {
    const { past } = this.source;
    if (!past) return null;
    return new TimeTravel(past, this.view, this.ask, {
      reload: (wanted) => this.showAsAsked(wanted),
      toggled: (isOpen) => {
        this.toolbar.showHistory(isOpen);
        this.view.makeRoom();
      },
    });
  }

  private async loadTimeline(): Promise<void> {
    await this.travel?.load();
    this.toolbar.offerHistory(this.travel?.isOffered ?? false);
  }

  /** Loads the map as it is asked about now, which may be as it was. */
  private showAsAsked(wanted: () => boolean): Promise<void> {
    const task = this.reloading.then(async () => {
      if (!wanted()) return;
      this.values.setPast(this.travel?.time != null);
      this.show(await this.source.map());
      this.ask.refresh();
    });
    this.reloading = task.catch(() => undefined);
    return task;
  }

  private show(info: MapInfo): void {
    this.context.info = info;
    const { frame_id } = this.context.frame;
    this.context.frame = info.frames.find((one) => one.frame_id === frame_id) ?? baseFrame(info);
    this.view.setInfo(info);
    const hasGrid = info.layers.some(({ class_name }) => class_name === "OccupancyGridLayer");
    const time = this.travel?.time ?? null;
    this.toolbar.offerEdit(this.editor !== null && !time);
    this.toolbar.offer("note", this.editor !== null && !time);
    this.toolbar.offer("path", hasGrid && this.source.path !== undefined && !time);
    this.toolbar.offer("cover", hasGrid && info.can_cover === true && !time);
    this.search.setInfo(info);
    if (this.source.ask) this.search.offerQuestions();
    this.conditions.setInfo(info);
    this.layers.draw();
    this.values.draw();
    this.status.setFrames(info.frames, this.context.frame);
    this.view.setFrame(this.context.frame);
    this.editor?.update();
    void this.notes.setInfo(info).catch(complain);
    const mark = info.unsaved ? "• " : "";
    document.title = `${mark}${info.name} – Hypermap`;
    byId("title").textContent = info.name;
    byId("title").classList.toggle("unsaved", info.unsaved);
    const total = (areRooms: boolean) =>
      info.layers
        .filter(({ kind, name }) => kind === "shapes" && (name === ROOMS) === areRooms)
        .reduce((n, { count }) => n + count, 0);
    const rooms = total(true) > 0 ? `, ${plural(total(true), "room")}` : "";
    byId("subtitle").textContent =
      `${plural(total(false), "object")}${rooms} · ${time ?? (info.unsaved ? "not saved" : describe(info))}`;
  }

  private listen(): void {
    const { map } = this.view;
    map.on("singleclick", ({ coordinate: [x, y] }) => this.click([x, y]));
    map.on("pointermove", ({ coordinate: [x, y] }) => this.setPointer([x, y]));
    map.getViewport()?.addEventListener("pointerleave", () => this.setPointer(null));
    map.on("moveend", () => this.linkPlace());
    const scaled = () => this.status.setResolution(this.view.resolution);
    map.getView().on("change:resolution", scaled);
    scaled();
    window.addEventListener("hashchange", () => this.restorePlace());
    window.addEventListener("beforeunload", (event) => {
      if (this.editor && this.context.info.unsaved) event.preventDefault();
    });
    byId("ask").addEventListener("submit", (event) => {
      event.preventDefault();
      this.find();
    });
    watchKeys({
      escape: () => this.escape(),
      search: () => {
        toggleSidebar(true);
        this.search.focus();
      },
      fit: () => this.view.fit(this.context.info.extent),
      history: () => this.toggleHistory(),
      finish: () => this.drawing.finish(),
      back: () => this.drawing.back(),
      remove: () => this.editor?.active && this.editor.remove(),
      undo: () => this.editor?.active && this.editor.undo(),
      redo: () => this.editor?.active && this.editor.redo(),
      save: () => this.editor && this.context.info.unsaved && this.editor.save(),
      isDrawing: () => this.drawing.active,
    });
  }

  private setPointer(place: Point | null): void {
    this.status.setPointer(place);
    this.values.setPointer(place);
  }

  private restyle(): void {
    this.view.restyle(this.settings);
    this.values.restyle();
  }

  private click(place: Point): void {
    if (this.drawing.active) return;
    this.hint(null);
    this.isSearching = false;
    if (NARROW.matches) toggleSidebar(false);
    const note = this.notes.at(place);
    if (this.notes.active) {
      this.toolbar.showTool("point");
      this.notes.write(place);
    } else if (this.paths.active) this.paths.click(place);
    else if (note) this.notes.show(note);
    else if (this.editor?.active) void this.editor.pick(place).catch(complain);
    else this.ask.point(place);
  }

  private choose(tool: Tool): void {
    this.editor?.stop();
    this.drawing.stop();
    this.paths.stop();
    this.notes.stop();
    this.toolbar.showTool(tool);
    if (tool === "path") return this.paths.begin();
    if (tool === "note") return this.notes.begin();
    if (tool === "cover") this.ask.coverage();
    if (tool === "point") {
      this.hint("Click the map to query a point");
      return;
    }
    this.hint(tool === "rectangle" ? "Drag a rectangle to list what is in it" : CORNERS);
    this.drawing.start(tool === "cover" ? "polygon" : tool, (ring) => {
      this.hint(null);
      this.toolbar.showTool("point");
      if (tool === "cover") this.ask.cover(ring);
      else this.ask.area(ring);
    });
  }

  /** Runs the search of the fields; the list of matches gets the keyboard focus. */
  private find(): void {
    if (this.search.isQuestion && this.source.ask) {
      this.startSearch();
      this.ask.question(this.search.name);
      return;
    }
    const sought = this.conditions.with(this.search.name);
    const { name, near, within, inside, ring } = sought;
    if ([name, near, within, inside, ring].every((part) => part === null)) return;
    this.startSearch();
    this.ask.find(sought, true);
  }

  private startSearch(): void {
    if (NARROW.matches) toggleSidebar(false);
    this.editor?.letGo();
    this.hint(null);
    this.isSearching = true;
  }

  private drawToFind(kind: Kind, done: (ring: Ring) => void): void {
    this.editor?.stop();
    this.stopPaths();
    this.hint(kind === "rectangle" ? "Drag a rectangle to search in" : CORNERS);
    if (NARROW.matches) toggleSidebar(false);
    this.drawing.start(kind, (ring) => {
      this.hint(null);
      done(ring);
      this.find();
    });
  }

  private toggleEdit(): void {
    if (!this.editor) return;
    this.drawing.stop();
    this.stopPaths();
    if (this.editor.active) return this.editor.stop();
    this.panel.close();
    this.ask.forget();
    this.editor.start();
  }

  private toggleHistory(): void {
    if (!this.travel?.isOffered) return;
    if (this.travel.isOpen) return void this.travel.close().catch(complain);
    this.choose("point");
    this.hint(null);
    void this.travel.open().catch(complain);
  }

  private stopPaths(): void {
    this.paths.stop();
    this.toolbar.showTool("point");
  }

  private escape(): void {
    if (this.drawing.active) {
      this.drawing.stop();
      this.toolbar.showTool("point");
      this.hint(null);
    } else if (this.editor?.endMerging()) {
      return;
    } else if (this.panel.isOpen) {
      const goesBack = this.isSearching && byId("panel").contains(document.activeElement);
      this.panel.close();
      if (goesBack) this.search.focus();
    } else if (this.notes.active) {
      this.notes.stop();
      this.toolbar.showTool("point");
      this.hint(null);
    } else if (this.paths.active) {
      this.stopPaths();
      this.ask.forget();
      this.hint(null);
    } else if (this.editor?.active) this.editor.stop();
    else if (this.travel?.isOpen) void this.travel.close().catch(complain);
    else {
      this.hint(null);
      if (NARROW.matches) toggleSidebar(false);
    }
  }

  private panelClosed(): void {
    this.view.makeRoom();
    this.editor?.letGo();
    this.notes.letGo();
    this.ask.forget();
  }

  private onEvent(change: Change | "lost" | "refused"): void {
    if (change === "lost" || change === "refused") return this.banner(SERVER[change]);
    this.banner(change.disk ? DISK[change.disk] : null, change.disk === "changed");
    void this.onChange(change).catch(complain);
  }

  /** Reloads the file; asks first if that would lose changes. */
  private async reload(): Promise<void> {
    if (this.context.info.unsaved) {
      const answer = await choose("Reload the file?", "Unsaved changes will be lost.", [
        { value: "cancel", label: "Cancel" },
        { value: "reload", label: "Reload", look: "danger" },
      ]);
      if (answer !== "reload") return;
    }
    const change = await this.source.editing?.reload();
    this.banner(null);
    if (change) await this.onChange(change);
  }

  /** Applies a change from this window or another; a known one is skipped. */
  private onChange(change: Change): Promise<void> {
    if (change.saved) this.banner(null);
    const task = this.reloading.then(async () => {
      const { info } = this.context;
      const { version, can_undo, can_redo, unsaved } = change;
      // The file may have been saved under another name.
      const known = !change.saved && info.version === version && info.unsaved === unsaved;
      if (known && info.can_undo === can_undo && info.can_redo === can_redo) return;
      this.show(await this.source.map());
      const now = this.context.info;
      if (change.saved || now.opened !== info.opened) void this.loadTimeline().catch(complain);
      if (now.version === info.version) return;
      const isAnother = now.opened !== info.opened && String(now.extent) !== String(info.extent);
      if (isAnother) this.view.fit(now.extent);
      if (this.editor?.active) await this.editor.refresh();
      else this.ask.refresh();
    });
    this.reloading = task.catch(() => undefined);
    return task;
  }

  private setFrame(name: string): void {
    const { info } = this.context;
    this.context.frame = info.frames.find(({ frame_id }) => frame_id === name) ?? baseFrame(info);
    this.status.setFrames(info.frames, this.context.frame);
    this.view.setFrame(this.context.frame);
    this.ask.refresh();
    this.linkPlace();
  }

  /** Keeps the view in the address, but not at every step of a movement. */
  private linkPlace(): void {
    window.clearTimeout(this.hashTimer);
    this.hashTimer = window.setTimeout(() => {
      const { info, frame } = this.context;
      const chosen = frame.frame_id === info.base_frame ? null : frame.frame_id;
      try {
        history.replaceState(null, "", placeToHash(this.view.place(chosen)));
      } catch {
        // Some browsers refuse this for a local file.
      }
    }, 200);
  }

  private restorePlace(): void {
    const place = placeFromHash(location.hash);
    if (!place) return this.view.fit(this.context.info.extent, false);
    for (const shown of this.view.layers.values()) {
      const visible = !place.hidden.includes(shown.info.name);
      if (isVisible(shown) !== visible) drawnLayer(shown)?.setVisible(visible);
    }
    this.layers.draw();
    this.values.draw();
    if (place.frame) this.setFrame(place.frame);
    this.view.setPlace(place);
  }

  /** Notes if not all objects in view are drawn. */
  private tellCounts(): void {
    let [shown, total] = [0, 0];
    for (const layer of this.view.layers.values()) {
      if (!layer.shapes || !isVisible(layer)) continue;
      shown += layer.shapes.shown;
      total += layer.shapes.total;
    }
    const notice = byId("notice");
    notice.hidden = shown >= total;
    notice.textContent = `The ${count(shown)} largest of ${count(total)} objects; zoom in for more`;
  }

  private hint(text: string | null): void {
    byId("hint").hidden = text === null;
    byId("hint").textContent = text;
  }

  private banner(text: string | null, offerReload = false): void {
    byId("banner").hidden = text === null;
    const open = () => void this.reload().catch(complain);
    const button = el("button", { type: "button", class: "button small", text: "Reload" });
    button.onclick = open;
    byId("banner").replaceChildren(text ?? "", ...(offerReload ? [button] : []));
  }
}

const CORNERS = "Click the corners of an area; double-click or Enter finishes";

const SERVER = {
  lost: "The server does not respond. Is hypermap view still running?",
  refused: "The server was restarted. Open the address that it printed then.",
};
const DISK = {
  changed: "The map file has changed on disk.",
  vanished: "The map file was deleted from disk; saving writes it again.",
};

function baseFrame(info: MapInfo): Frame {
  const base = info.frames.find(({ frame_id }) => frame_id === info.base_frame);
  return base ?? { frame_id: info.base_frame, x: 0, y: 0, yaw: 0 };
}

function describe({ extent }: MapInfo): string {
  if (!extent) return "empty";
  return `${(extent[2] - extent[0]).toFixed(1)} × ${(extent[3] - extent[1]).toFixed(1)} m`;
}
