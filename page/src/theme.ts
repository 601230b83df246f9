/** The theme of the page: its switch, and how both pages react to a change. */

import { icon, iconButton } from "./dom";
import { keepSettings, onSystemTheme, themeOf, type Settings } from "./settings";

export class ThemeSwitch {
  readonly button = iconButton("moon", "Dark", () => this.toggle(), { id: "theme" });

  /** Calls `changed` after each change, including changes of the system's theme. */
  constructor(
    private readonly settings: Settings,
    private readonly changed: () => void,
  ) {
    onSystemTheme(() => this.apply());
  }

  /** Applies the theme of the settings, and saves them. */
  apply(): void {
    const theme = themeOf(this.settings);
    document.documentElement.dataset["theme"] = theme;
    const label = theme === "dark" ? "Light theme" : "Dark theme";
    this.button.replaceChildren(icon(theme === "dark" ? "sun" : "moon"));
    this.button.title = label;
    this.button.setAttribute("aria-label", label);
    this.changed();
    keepSettings(this.settings);
  }

  /** Calls a function while the page has its light theme. */
  inLight(draw: () => void): void {
    const { dataset } = document.documentElement;
    const theme = dataset["theme"];
    dataset["theme"] = "light";
    this.changed();
    draw();
    dataset["theme"] = theme ?? "light";
    this.changed();
  }

  private toggle(): void {
    this.settings.theme = themeOf(this.settings) === "dark" ? "light" : "dark";
    this.apply();
  }
}
