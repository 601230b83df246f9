/** Paths from clicks: the first one is the start, the second one the goal. */

import type { Point } from "./source";

export interface PathVerbs {
  /** Marks where a path starts. */
  mark: (start: Point) => void;
  find: (start: Point, goal: Point) => void;
  hint: (text: string | null) => void;
}

export class PathTool {
  active = false;
  private start: Point | null = null;

  constructor(private readonly verbs: PathVerbs) {}

  begin(): void {
    this.active = true;
    this.again();
  }

  /** Waits for the start. */
  again(): void {
    this.start = null;
    this.verbs.hint("Click the start of the path");
  }

  click(place: Point): void {
    const { start } = this;
    if (start) {
      this.again();
      this.verbs.hint(null);
      this.verbs.find(start, place);
    } else {
      this.verbs.mark(place);
      this.start = place;
      this.verbs.hint("Click the goal of the path");
    }
  }

  stop(): void {
    this.active = false;
    this.start = null;
  }
}
