/** The user's settings, stored in the browser if it allows that. */

export type Theme = "light" | "dark";

export interface Settings {
  theme: Theme | null;
  grid: boolean;
  labels: boolean;
  /** Pixels. */
  labelSize: number;
  frames: boolean;
}

const KEY = "hypermap";
const DEFAULTS: Settings = { theme: null, grid: false, labels: true, labelSize: 13, frames: false };

export function loadSettings(): Settings {
  try {
    return { ...DEFAULTS, ...(JSON.parse(localStorage.getItem(KEY) ?? "{}") as Partial<Settings>) };
  } catch {
    return { ...DEFAULTS };
  }
}

export function keepSettings(settings: Settings): void {
  try {
    localStorage.setItem(KEY, JSON.stringify(settings));
  } catch {
    // A private window stores nothing; the page works without.
  }
}

const dark = window.matchMedia("(prefers-color-scheme: dark)");

export const themeOf = (settings: Settings): Theme =>
  settings.theme ?? (dark.matches ? "dark" : "light");

export const onSystemTheme = (changed: () => void): void =>
  dark.addEventListener("change", changed);

/** The page's colors, for what is drawn on a canvas. */
export function cssColor(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}
