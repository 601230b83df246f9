/** What is known of an object, in words. */

import { clock, isDate, stamp } from "./format";

/** How certain it is that an object exists, from its evidence [log-odds]. */
export function existenceInWords(existence: number): string {
  if (existence >= 4) return "certainly there";
  if (existence >= 2) return "very likely there";
  if (existence > 0) return "possibly there";
  return existence > -2 ? "possibly removed" : "very likely removed";
}

/** How often an object was seen, and when last, as "39 times, last Monday 14:02". */
export function seenInWords(count: number | null, last: number | null, now: Date): string | null {
  const times = count === null ? "" : often(count);
  if (last === null) return times || null;
  return [times, `last ${whenInWords(last, now)}`].filter(Boolean).join(", ");
}

export const often = (n: number): string => (n === 1 ? "once" : n === 2 ? "twice" : `${n} times`);

/** A time stamp [s] in words; within a week, by the day of the week. */
export function whenInWords(seconds: number, now: Date): string {
  if (!isDate(seconds)) return `at ${stamp(seconds)}`;
  const time = new Date(seconds * 1000);
  const clock = `${two(time.getHours())}:${two(time.getMinutes())}`;
  const days = Math.round((midnight(now) - midnight(time)) / 86_400_000);
  if (days === 0) return `today ${clock}`;
  if (days === 1) return `yesterday ${clock}`;
  if (days > 1 && days < 7) return `${name(time, { weekday: "long" })} ${clock}`;
  const date = `${time.getDate()} ${name(time, { month: "long" })}`;
  if (time.getFullYear() !== now.getFullYear()) return `${date} ${time.getFullYear()}, ${clock}`;
  return `${date} ${clock}`;
}

const HOUR = 3600;

/** Whether two stamps [s] are dates so far apart that they are hardly of one drive. */
export const areOfSeveralDrives = (first: number, last: number): boolean =>
  isDate(last) && last - first >= HOUR;

/** Says when observations were made [s]: the time since `start`, or of several drives the date. */
export function timesInWords(start: number, last: number, now: Date): (seconds: number) => string {
  if (areOfSeveralDrives(start, last)) return (seconds) => whenInWords(seconds, now);
  return (seconds) => `at ${clock(seconds - start)}`;
}

const two = (n: number): string => String(n).padStart(2, "0");
const midnight = (time: Date): number => new Date(time).setHours(0, 0, 0, 0);
const name = (time: Date, part: Intl.DateTimeFormatOptions): string =>
  new Intl.DateTimeFormat("en", part).format(time);
