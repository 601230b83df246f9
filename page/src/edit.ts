/** Changing the map: add, rename, tag, reshape and delete objects; undo, redo and save. */

import Feature from "ol/Feature.js";
import MultiPolygon from "ol/geom/MultiPolygon.js";
import VectorLayer from "ol/layer/Vector.js";
import VectorSource from "ol/source/Vector.js";
import type { Ask, Context } from "./ask";
import { askName, byId, choose, complain, el, notify } from "./dom";
import { Drawing, type Kind } from "./drawing";
import { EditBar } from "./editbar";
import { newObjectForm, objectForm } from "./forms";
import { Handles } from "./handles";
import { extentOf } from "./geometry";
import { editedLook, ROOMS } from "./looks";
import type { MapView } from "./mapview";
import type { Panel } from "./panel";
import {
  Refused,
  type Change,
  type DataSource,
  type Editing,
  type ObjectDetails,
  type Operation,
  type Point,
  type Polygon,
  type Ring,
  type SaveRequest,
} from "./source";

export class Editor {
  active = false;
  private readonly bar: EditBar;
  private readonly shapes = new VectorLayer({
    source: new VectorSource<Feature<MultiPolygon>>(),
    zIndex: 90,
    style: (_, resolution) => editedLook(resolution),
  });
  private readonly handles: Handles;
  private chosen: ObjectDetails | null = null;
  /** What was drawn, until it has a name and the server has accepted it. */
  private drawn: MultiPolygon | null = null;
  /** Whether the next click selects what is merged into the object being edited. */
  private isMerging = false;
  /** Changes are sequential, so that each knows the version that the last one made. */
  private queue: Promise<void> = Promise.resolve();

  constructor(
    private readonly view: MapView,
    private readonly source: DataSource,
    private readonly editing: Editing,
    private readonly panel: Panel,
    private readonly ask: Ask,
    private readonly drawing: Drawing,
    private readonly context: Context,
    private readonly hint: (text: string | null) => void,
    private readonly changed: (change: Change) => Promise<void>,
  ) {
    this.handles = new Handles(
      view.map,
      this.shapes,
      (how) => this.reshape(how),
      () => drawing.active,
    );
    this.bar = new EditBar({
      draw: (kind, room) => this.draw(kind, room),
      findRooms: () => this.findRooms(),
      undo: () => this.undo(),
      redo: () => this.redo(),
      save: () => this.save(),
      saveAs: () => void this.saveAs(),
      done: () => this.stop(),
    });
    ask.actions = (object) => this.actions(object);
    this.update();
  }

  /** Called when edit mode starts or ends. */
  toggled: (active: boolean) => void = () => {};

  start(): void {
    if (this.active) return;
    this.active = true;
    this.view.map.addLayer(this.shapes);
    this.handles.start();
    byId("editbar").hidden = false;
    this.hint("Click an object to edit it, or draw a new one");
    this.toggled(true);
  }

  stop(): void {
    if (!this.active) return;
    this.active = false;
    this.letGo();
    this.drawing.stop();
    this.handles.stop();
    this.view.map.removeLayer(this.shapes);
    byId("editbar").hidden = true;
    this.hint(null);
    this.panel.close();
    this.toggled(false);
  }

  /** Updates the available actions after the map changed. */
  update(): void {
    this.bar.update(this.context.info);
  }

  /** After the map changed: shows the selected object again if it has changed. */
  async refresh(): Promise<void> {
    const before = this.chosen;
    if (!before) return;
    const now = await this.editing.objectIfThere(before.layer, before.id);
    if (this.chosen !== before) return;
    if (!now) {
      this.letGo();
      this.panel.close();
    } else if (now.name !== before.name || now.tags.join() !== before.tags.join()) {
      this.choose(now);
    } else if (JSON.stringify(now) !== JSON.stringify(before)) {
      this.chosen = now; // only its shape is another: what is being typed stays
      this.outline(new MultiPolygon(now.polygons));
    }
  }

  /** Starts editing the object at a place: the smallest, if there are several. */
  async pick(place: Point): Promise<void> {
    if (this.drawn) return;
    const answer = await this.source.at(place, this.context.info.base_frame);
    const open = new Set(this.layers());
    const here = answer.layers
      .filter(({ name }) => open.has(name))
      .flatMap(({ name, objects }) => objects.map((object) => ({ layer: name, ...object })))
      .sort((a, b) => (a.area ?? 0) - (b.area ?? 0));
    if (this.isMerging) return this.merge(here);
    if (here.length) await this.take(here[0].layer, here[0].id);
    else {
      this.letGo();
      this.panel.close();
    }
  }

  async take(layer: string, id: number): Promise<void> {
    this.start();
    this.ask.forget();
    this.choose(await this.source.object(layer, id));
  }

  /** Ends editing of the current object; true if there was one. */
  letGo(): boolean {
    const had = this.chosen !== null;
    this.endMerging();
    this.chosen = null;
    this.drawn = null;
    this.shapes.getSource()?.clear();
    return had;
  }

  /** Cancels whatever waits for a click; true if something did. */
  endMerging(): boolean {
    const was = this.isMerging;
    this.isMerging = false;
    if (was) this.hint(null);
    return was;
  }

  private startMerging(): void {
    if (!this.chosen) return;
    this.isMerging = true;
    this.hint(`Click the object to merge into ${this.chosen.name}; Esc cancels`);
  }

  /** Merges the object being edited with the first other one at a place. */
  private merge(here: { layer: string; id: number }[]): void {
    if (!this.chosen) return;
    const { layer, id, name } = this.chosen;
    const others = here.filter((one) => one.layer !== layer || one.id !== id);
    const other = others.find((one) => one.layer === layer);
    if (!other) {
      if (others.length)
        notify(`Only objects in the same layer can be merged, here ${layer}`, "alert");
      return; // the next click may meet one
    }
    this.endMerging();
    void this.apply([{ op: "merge", layer, id, others: [other.id] }], `Merged into ${name}`);
  }

  /** Splits the room being edited along a line that the user draws. */
  private split(): void {
    if (!this.chosen) return;
    const { layer, id, name } = this.chosen;
    this.endMerging();
    this.hint(`Click both ends of a line across ${name}, from wall to wall; Esc cancels`);
    this.drawing.start("line", (line) => {
      this.hint(null);
      void this.apply([{ op: "split", layer, id, line }], `Split ${name}`);
    });
  }

  private findRooms(): void {
    this.letGo();
    this.panel.close();
    this.hint("Looking for rooms…");
    void this.apply([{ op: "find_rooms", layer: ROOMS }], "Found rooms").finally(() =>
      this.hint(null),
    );
  }

  /** Adds a copy next to the object being edited. */
  private duplicate(): void {
    if (!this.chosen) return;
    const { layer, id, name, polygons } = this.chosen;
    const [x0, , x1] = extentOf(polygons);
    const by = x1 - x0 + 12 * this.view.resolution;
    const moved = polygons.map((rings) =>
      rings.map((ring) => ring.map(([x, y]): Point => [x + by, y])),
    );
    const copy: Operation = { op: "add", layer, name, like: id, polygons: moved };
    void this.apply([copy], `Duplicated ${name}`, true);
  }

  remove(): void {
    if (!this.chosen) return;
    const { layer, id, name } = this.chosen;
    this.letGo();
    this.panel.close();
    void this.apply([{ op: "remove", layer, id }], `Deleted ${name}`);
  }

  undo(): void {
    if (!this.context.info.can_undo) return;
    void this.run((version) => this.editing.undo(version), "Undone");
  }

  redo(): void {
    if (!this.context.info.can_redo) return;
    void this.run((version) => this.editing.redo(version), "Redone");
  }

  save(request: SaveRequest = {}): void {
    void this.enqueue(async () => {
      try {
        await this.changed(await this.editing.save(request));
        notify("Saved");
      } catch (error) {
        if (!(error instanceof Refused) || error.status !== 409) throw error;
        const answer = await choose("Overwrite it?", error.message, [
          { value: "cancel", label: "Cancel" },
          { value: "saveAs", label: "Save as…", look: "primary" },
          { value: "overwrite", label: "Overwrite", look: "danger" },
        ]);
        if (answer === "overwrite") this.save({ ...request, overwrite: true });
        if (answer === "saveAs") void this.saveAs();
      }
    });
  }

  /** Saves under another name in the same folder, and continues with that file. */
  private async saveAs(): Promise<void> {
    const stem = this.context.info.name.replace(/\.[^.]*$/, "");
    const name = await askName(
      "Save as",
      "In the same folder. This page will then show and save that file.",
      `${stem}.hmap`,
      "Save",
    );
    if (name) this.save({ path: /\.hmap$/i.test(name) ? name : `${name}.hmap` });
  }

  private choose(object: ObjectDetails): void {
    this.letGo();
    this.chosen = object;
    this.outline(new MultiPolygon(object.polygons));
    this.panel.show({
      title: object.name,
      summary: `Object ${object.id} of ${object.layer}`,
      content: [
        objectForm(object, this.names(), {
          change: (values) => {
            const { layer, id } = object;
            void this.apply([{ op: "update", layer, id, ...values }], "Changed");
          },
          duplicate: () => this.duplicate(),
          merge: () => this.startMerging(),
          split: object.layer === ROOMS ? () => this.split() : undefined,
          remove: () => this.remove(),
        }),
      ],
    });
  }

  /** Shows the editable outline. */
  private outline(shape: MultiPolygon): void {
    this.shapes.getSource()?.clear();
    this.shapes.getSource()?.addFeature(new Feature(shape));
  }

  private draw(kind: Kind, room: boolean): void {
    this.letGo();
    this.panel.close();
    this.hint(
      kind === "rectangle"
        ? "Drag a rectangle"
        : "Click the corners; double-click or Enter finishes, Backspace removes the last one",
    );
    this.drawing.start(kind, (ring) => this.describe(ring, room));
  }

  /** Asks for the name of a new shape; until it is added, its corners can be dragged. */
  private describe(ring: Ring, room: boolean): void {
    this.hint(null);
    const drawn = new MultiPolygon([[[...ring, ring[0]]]]);
    this.drawn = drawn;
    this.outline(drawn);
    this.panel.show({
      title: room ? "New room" : "New object",
      summary: "Give it a name",
      content: [
        newObjectForm(this.names(), this.layers(), room, this.taken(), {
          add: ({ isNewLayer, ...values }) => {
            const polygons = drawn.getCoordinates() as Polygon[];
            const layer: Operation = { op: "add_layer", layer: values.layer };
            const object: Operation = { op: "add", polygons, ...values };
            return this.apply(
              isNewLayer ? [layer, object] : [object],
              `Added ${values.name}`,
              true,
            );
          },
          cancel: () => this.panel.close(),
        }),
      ],
    });
    byId("object-name").focus();
  }

  private reshape(how: string): void {
    const feature = this.shapes.getSource()?.getFeatures()[0];
    if (!this.chosen || !feature) return;
    const polygons = (feature.getGeometry() as MultiPolygon).getCoordinates() as Polygon[];
    const { layer, id } = this.chosen;
    void this.apply([{ op: "update", layer, id, polygons }], how);
  }

  /** Changes the map; resolves to whether that was possible. */
  private apply(operations: Operation[], done: string, take = false): Promise<boolean> {
    return this.run(async (version) => {
      const change = await this.editing.edit(version, operations);
      const id = change.ids?.[0];
      if (take && id !== undefined) {
        void this.enqueue(() => this.take(operations[0].layer, id));
      }
      return change;
    }, done);
  }

  private async run(change: (version: number) => Promise<Change>, done: string): Promise<boolean> {
    let isDone = false;
    await this.enqueue(async () => {
      try {
        await this.changed(await change(this.context.info.version));
        isDone = true;
        notify(done);
      } catch (error) {
        complain(error);
        // The page shows the server's state again; typed text stays, to be corrected.
        await this.changed({});
        if (this.chosen) this.outline(new MultiPolygon(this.chosen.polygons));
      }
    });
    return isDone;
  }

  private enqueue(task: () => Promise<void>): Promise<void> {
    this.queue = this.queue.then(task).catch(complain);
    return this.queue;
  }

  private actions({ layer, id }: ObjectDetails): HTMLElement | null {
    if (!this.layers().includes(layer)) return null;
    return el("button", {
      type: "button",
      class: "button small",
      text: "Edit",
      onclick: () => void this.take(layer, id).catch(complain),
    });
  }

  private layers(): string[] {
    const { layers } = this.context.info;
    return layers
      .filter(({ kind, editable }) => kind === "shapes" && editable !== false)
      .map(({ name }) => name);
  }

  private taken(): string[] {
    return this.context.info.layers.map(({ name }) => name);
  }

  private names(): string[] {
    const names = this.context.info.layers.flatMap(({ classes }) =>
      classes.map(({ name }) => name),
    );
    return [...new Set(names)].sort();
  }
}
