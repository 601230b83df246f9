/** The theme of the page: its switch, and what both pages do when it changes. */

import { icon, iconButton } from "./dom";
import { keepSettings, onSystemTheme, themeOf, type Settings } from "./settings";

export class ThemeSwitch {
  readonly button = iconButton("moon", "Dark", () => this.toggle(), { id: "theme" });

  /** Redraws by `changed` after each change, also of the system's theme. */
  constructor(
    private readonly settings: Settings,
    private readonly changed: () => void,
  ) {
    onSystemTheme(() => this.apply());
  }

  /** Shows the page in the theme of the settings, and keeps them. */
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

  private toggle(): void {
    this.settings.theme = themeOf(this.settings) === "dark" ? "light" : "dark";
    this.apply();
  }
}
