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
