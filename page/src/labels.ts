/** Label placement: on shapes that are large enough, and next to others. */

/** [x0, y0, x1, y1] in pixels; y grows upwards. */
export type Box = [number, number, number, number];

export const SIDES = ["on", "low", "high", "right", "above", "below", "left"] as const;
export type Side = (typeof SIDES)[number];

export interface Named {
  /** Of the shape. */
  box: Box;
  /** Where its name belongs, if there is room. */
  at: [number, number];
  /** Width and height of the name [pixels]. */
  size: [number, number];
}

/** Gap between a label and the shape next to it [pixels]. */
export const GAP = 4;
/** A shape is large enough for its label if this many labels would fit side by side. */
const ROOM = 1.25;
/** Vertical offset of a name that is not in the middle [its heights]. */
export const STEP = 1.4;
/** Side of the squares of the spatial index [pixels]. */
const NEAR = 64;

/** Returns the side on which each name stands, or null where there is no room: names lie neither on
 * each other nor on other things, unless those bear what is named, as a table bears a cup; and
 * within bounds where they can. Large things choose first. */
export function placeLabels(things: Named[], bounds: Box | null = null): (Side | null)[] {
  const boxes = new Nearby();
  const names = new Nearby();
  for (const { box } of things) boxes.add(box);
  const placed = new Array<Side | null>(things.length).fill(null);
  const order = things.map((_, i) => i).sort((a, b) => area(things[b].box) - area(things[a].box));
  for (const i of order) {
    const thing = things[i];
    const bears = (box: Box) => holds(box, middle(thing.box)) && area(box) > area(thing.box);
    const isFree = (name: Box) =>
      !names.meeting(name).length &&
      !boxes.meeting(name).some((box) => box !== thing.box && !bears(box));
    const sides = SIDES.filter((side) => !ON.has(side) || isWithin(thing, side));
    const free = sides.filter((side) => isFree(nameAt(thing, side)));
    const side = free.find((side) => !bounds || isIn(nameAt(thing, side), bounds)) ?? free[0];
    // A name on its own shape may cover objects on that shape rather than be left out.
    const hasRoom = isWithin(thing, "on") && !names.meeting(nameAt(thing, "on")).length;
    const own = hasRoom ? "on" : null;
    placed[i] = side ?? own;
    if (placed[i]) names.add(nameAt(thing, placed[i]));
  }
  return placed;
}

function nameAt({ box, at, size: [width, height] }: Named, side: Side): Box {
  const [x0, y0, x1, y1] = box;
  const [mx, my] = middle(box);
  const around = (x: number, y: number): Box => [
    x - width / 2,
    y - height / 2,
    x + width / 2,
    y + height / 2,
  ];
  if (side === "right") return around(x1 + GAP + width / 2, my);
  if (side === "left") return around(x0 - GAP - width / 2, my);
  if (side === "above") return around(mx, y1 + GAP + height / 2);
  if (side === "below") return around(mx, y0 - GAP - height / 2);
  const step = side === "low" ? -STEP : side === "high" ? STEP : 0;
  return around(at[0], at[1] + step * height);
}

const ON: ReadonlySet<Side> = new Set(["on", "low", "high"]);

/** Whether a name that is placed on its object is within it. */
function isWithin(thing: Named, side: Side): boolean {
  const { box, size } = thing;
  const [, low, , high] = nameAt(thing, side);
  return ROOM * size[0] <= box[2] - box[0] && box[1] <= low && high <= box[3];
}

const middle = ([x0, y0, x1, y1]: Box): [number, number] => [(x0 + x1) / 2, (y0 + y1) / 2];
const area = ([x0, y0, x1, y1]: Box): number => (x1 - x0) * (y1 - y0);
const isIn = (box: Box, bounds: Box): boolean =>
  bounds[0] <= box[0] && bounds[1] <= box[1] && box[2] <= bounds[2] && box[3] <= bounds[3];
const holds = ([x0, y0, x1, y1]: Box, [x, y]: [number, number]): boolean =>
  x0 <= x && x <= x1 && y0 <= y && y <= y1;

/** Boxes by the squares that they reach into. */
class Nearby {
  private readonly squares = new Map<string, Box[]>();
  /** Boxes that overlap very many squares. */
  private readonly large: Box[] = [];

  add(box: Box): void {
    if (area(box) > 400 * NEAR * NEAR) return void this.large.push(box);
    for (const key of squaresOf(box)) {
      const here = this.squares.get(key);
      if (here) here.push(box);
      else this.squares.set(key, [box]);
    }
  }

  meeting([x0, y0, x1, y1]: Box): Box[] {
    const near = squaresOf([x0, y0, x1, y1]).flatMap((key) => this.squares.get(key) ?? []);
    return [...near, ...this.large].filter(
      (box) => box[0] < x1 && x0 < box[2] && box[1] < y1 && y0 < box[3],
    );
  }
}

function squaresOf([x0, y0, x1, y1]: Box): string[] {
  const keys = [];
  for (let column = Math.floor(x0 / NEAR); column <= Math.floor(x1 / NEAR); column++) {
    for (let row = Math.floor(y0 / NEAR); row <= Math.floor(y1 / NEAR); row++) {
      keys.push(`${column} ${row}`);
    }
  }
  return keys;
}
