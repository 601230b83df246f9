/** Matches typed text with names. */

import type { ClassInfo } from "./source";

/** Names that contain a text: those that start with it first, then the most frequent. */
export function matching(names: ClassInfo[], text: string): ClassInfo[] {
  const wanted = text.trim().toLowerCase();
  const starts = ({ name }: ClassInfo) => Number(name.toLowerCase().startsWith(wanted));
  return names
    .filter(({ name }) => name.toLowerCase().includes(wanted))
    .sort(
      (a, b) =>
        starts(b) - starts(a) ||
        b.count - a.count ||
        a.name.localeCompare(b.name, "en", { numeric: true }),
    );
}

/** The name that was meant: an exact match, else in other case, else the best one, else the text. */
export function bestName(names: ClassInfo[], typed: string): string {
  if (!typed || names.some(({ name }) => name === typed)) return typed;
  const same = names.find(({ name }) => name.toLowerCase() === typed.toLowerCase());
  return (same ?? matching(names, typed)[0])?.name ?? typed;
}

const ASKS =
  /^((where|what|who)(['’]?s)?|which|how|when|is|are|am|do|does|did|has|have|can|could|i|any|find|show|list|count|give|tell)\s/i;
// Also "the second nearest cup" and "two largest tables".
const COMPARES =
  /^(the |all )?(\w+[ -])?(nearest|closest|farthest|furthest|largest|biggest|smallest|tallest|newest)\s/i;
const RELATES =
  /\s(near|next to|by|in|inside|within|with|without|on|under|behind|between|beside)\s/i;

/** Whether a text is a question in English ("nearest cup", too), and no part of a name. */
export function isQuestion(names: ClassInfo[], text: string): boolean {
  if (names.some(({ name }) => name.toLowerCase() === text.toLowerCase())) return false;
  if (text.endsWith("?")) return true;
  const isAsked = [ASKS, COMPARES, RELATES].some((form) => form.test(text));
  return isAsked && !matching(names, text).length;
}

const MOST_ALIKE = 20;
/** At most this share of its letters may differ in a name that is taken for another. */
const WRONG = 0.4;

/** Names that contain a text, those that begin with it first; if there are none, similar names. */
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

/** Edit distance: how many letters to insert, delete or replace (Levenshtein). */
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
