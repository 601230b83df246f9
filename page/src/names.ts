/** Which names a typed text means. */

import type { ClassInfo } from "./source";

/** Names with a text in them: those that start with it first, then the commonest. */
export function matching(names: ClassInfo[], text: string): ClassInfo[] {
  const wanted = text.trim().toLowerCase();
  const starts = ({ name }: ClassInfo) => Number(name.toLowerCase().startsWith(wanted));
  return names
    .filter(({ name }) => name.toLowerCase().includes(wanted))
    .sort((a, b) => starts(b) - starts(a) || b.count - a.count || a.name.localeCompare(b.name));
}

/** The name that was meant: as typed, else in other letters, else the best match, else as typed. */
export function bestName(names: ClassInfo[], typed: string): string {
  if (!typed || names.some(({ name }) => name === typed)) return typed;
  const same = names.find(({ name }) => name.toLowerCase() === typed.toLowerCase());
  return (same ?? matching(names, typed)[0])?.name ?? typed;
}

const MOST_ALIKE = 20;
/** So many of its letters, at most, may differ in a name that is taken for another. */
const WRONG = 0.4;

/** Names that a text is part of, those that begin with it first, or else those that are like it. */
export function namesLike(known: string[], asked: string): string[] {
  const part = asked.toLowerCase();
  let found = known.filter((name) => name.toLowerCase().includes(part));
  if (!found.length) {
    found = known.filter((name) => edits(name.toLowerCase(), part) <= WRONG * name.length);
  }
  const begins = (name: string) => Number(name.toLowerCase().startsWith(part));
  return found
    .sort((a, b) => begins(b) - begins(a) || a.length - b.length || (a < b ? -1 : 1))
    .slice(0, MOST_ALIKE);
}

/** How many letters must be added, left out or replaced to get from one text to the other. */
function edits(one: string, other: string): number {
  let row = Array.from({ length: other.length + 1 }, (_, i) => i);
  for (let i = 1; i <= one.length; i++) {
    const next = [i];
    for (let j = 1; j <= other.length; j++) {
      const replaced = row[j - 1] + Number(one[i - 1] !== other[j - 1]);
      next.push(Math.min(row[j] + 1, next[j - 1] + 1, replaced));
    }
    row = next;
  }
  return row[other.length];
}
