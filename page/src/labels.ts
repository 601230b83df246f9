/** Label placement: on shapes that are large enough, and next to others. */

/** [x0, y0, x1, y1] in pixels; y grows upwards. */
export type Box = [number, number, number, number];

export const SIDES = ["on", "low", "high", "right", "above", "below", "left"] as const;
export type Side = (typeof SIDES)[number];

export interface Named {
  /** Around the shape. */
  box: Box;
  /** The shape itself; without it, the box is taken. */
  shape?: { meets: (box: Box) => boolean; holds: (point: [number, number]) => boolean };
  /** Where its name belongs, if there is room. */
  at: [number, number];
  /** Width and height of the name [pixels]. */
  size: [number, number];
}

/** Gap between a label and the shape next to it [pixels]. */
export const GAP = 4;
/** A shape is large enough for its label if this many labels would fit side by side. */
const ROOM = 1.25;
/** The same, where its label would stand nowhere else. */
const TIGHT = 0.87;
/** Vertical offset of a name that is not in the middle [its heights]. */
export const STEP = 1.4;
/** Side of the squares of the spatial index [pixels]. */
const NEAR = 64;

/** Returns the side on which each name stands, or null where there is no room: names lie neither on
 * each other nor on other things, unless those bear what is named, as a table bears a cup; and
 * within bounds where they can. Large things choose first. */
export function placeLabels(things: Named[], bounds: Box | null = null): (Side | null)[] {
  const others = new Nearby<Named>();
  const names = new Nearby<{ box: Box }>();
  for (const thing of things) others.add(thing);
  const placed = new Array<Side | null>(things.length).fill(null);
  const order = things.map((_, i) => i).sort((a, b) => area(things[b].box) - area(things[a].box));
  for (const i of order) {
    const thing = things[i];
    const isFree = (name: Box, bears: (other: Named) => boolean) =>
      !names.meeting(name).length &&
      !others
        .meeting(name)
        .some((other) => other !== thing && (other.shape?.meets(name) ?? true) && !bears(other));
    const best = (bears: (other: Named) => boolean) => {
      const sides = SIDES.filter((side) => !ON.has(side) || isWithin(thing, side, ROOM));
      const free = sides.filter((side) => isFree(nameAt(thing, side), bears));
      return free.find((side) => !bounds || isIn(nameAt(thing, side), bounds)) ?? free[0];
    };
    const isLarger = (other: Named) => area(other.box) > area(thing.box);
    const center = middle(thing.box);
    const onShape = best((other) => isLarger(other) && holds(other, center));
    // A name on its own shape may cover objects on that shape rather than be left out.
    const hasRoom = isWithin(thing, "on", TIGHT) && !names.meeting(nameAt(thing, "on")).length;
    const own = hasRoom ? "on" : null;
    // So may a name on what surrounds its shape, as a hall surrounds a small room.
    const around = () => best((other) => isLarger(other) && isAround(other.box, center));
    placed[i] = onShape ?? own ?? around() ?? null;
    if (placed[i]) names.add({ box: nameAt(thing, placed[i]) });
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
function isWithin(thing: Named, side: Side, room: number): boolean {
  const { box, size } = thing;
  const [, low, , high] = nameAt(thing, side);
  return room * size[0] <= box[2] - box[0] && box[1] <= low && high <= box[3];
}

const middle = ([x0, y0, x1, y1]: Box): [number, number] => [(x0 + x1) / 2, (y0 + y1) / 2];
const area = ([x0, y0, x1, y1]: Box): number => (x1 - x0) * (y1 - y0);
const isIn = (box: Box, bounds: Box): boolean =>
  bounds[0] <= box[0] && bounds[1] <= box[1] && box[2] <= bounds[2] && box[3] <= bounds[3];
const isAround = ([x0, y0, x1, y1]: Box, [x, y]: [number, number]): boolean =>
  x0 <= x && x <= x1 && y0 <= y && y <= y1;
const holds = ({ box, shape }: Named, point: [number, number]): boolean =>
  isAround(box, point) && (shape?.holds(point) ?? true);

/** Things with boxes by the squares that these reach into. */
class Nearby<Thing extends { box: Box }> {
  private readonly squares = new Map<string, Thing[]>();
  /** Things whose boxes overlap very many squares. */
  private readonly large: Thing[] = [];

  add(thing: Thing): void {
    if (area(thing.box) > 400 * NEAR * NEAR) return void this.large.push(thing);
    for (const key of squaresOf(thing.box)) {
      const here = this.squares.get(key);
      if (here) here.push(thing);
      else this.squares.set(key, [thing]);
    }
  }

  meeting([x0, y0, x1, y1]: Box): Thing[] {
    const near = squaresOf([x0, y0, x1, y1]).flatMap((key) => this.squares.get(key) ?? []);
    return [...near, ...this.large].filter(
      ({ box }) => box[0] < x1 && x0 < box[2] && box[1] < y1 && y0 < box[3],
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
