/** Shows the map as it was: joins the timeline, the map on the screen and the panel. */

import type { Ask } from "./ask";
import type { MapView } from "./mapview";
import type { Past, Version } from "./source";
import { TimeBar, timeOf } from "./timebar";

export interface TravelVerbs {
  /** Loads the map again, of the version that is asked about now, if that is still `wanted`. */
  reload: (wanted: () => boolean) => Promise<void>;
  /** The timeline was opened or closed. */
  toggled: (isOpen: boolean) => void;
}

export class TimeTravel {
  private readonly bar: TimeBar;
  private wanted: Version | null = null;
  private shown: Version | null = null;

  constructor(
    private readonly past: Past,
    private readonly view: MapView,
    ask: Ask,
    private readonly verbs: TravelVerbs,
  ) {
    this.bar = new TimeBar({
      show: (version, isNow) => this.show(version, isNow),
      list: () => ask.changes(past, () => this.bar.shown, this.bar.colors),
      close: () => void this.close(),
    });
  }

  /** Loads the versions; a shown one that is not known any more gives way to the present. */
  async load(): Promise<void> {
    this.bar.update(await this.past.timeline());
    const isLost = this.shown !== null && this.bar.isNow;
    if (isLost || !this.bar.hasPast) await this.close();
  }

  get isOffered(): boolean {
    return this.bar.hasPast;
  }

  get isOpen(): boolean {
    return this.bar.isOpen;
  }

  /** When the map was as it is shown; null for now. */
  get time(): string | null {
    return this.shown && timeOf(this.shown);
  }

  async open(): Promise<void> {
    if (!this.bar.shown) return;
    this.bar.open();
    this.verbs.toggled(true);
    await this.show(this.bar.shown, true);
  }

  /** Returns to the present. */
  async close(): Promise<void> {
    if (!this.isOpen) return;
    this.bar.close();
    this.verbs.toggled(false);
    this.view.markChanges([], {});
    if (this.bar.shown) await this.show(this.bar.shown, true);
  }

  private async show(version: Version, isNow: boolean): Promise<void> {
    this.wanted = version;
    const isWanted = () => this.wanted === version;
    this.shown = isNow ? null : version;
    this.past.goTo(isNow ? null : version.version);
    await this.verbs.reload(isWanted);
    if (!isWanted() || !this.isOpen) return;
    const { changes } = this.bar.isFirst
      ? { changes: [] }
      : await this.past.changes(version.version);
    if (isWanted() && this.isOpen) this.view.markChanges(changes, this.bar.colors);
  }
}
