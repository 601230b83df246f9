/** What the map shows in addition to its layers. */

import { byId, el } from "./dom";
import type { Settings } from "./settings";

type Switch = "grid" | "labels" | "frames";

export function settingsPanel(settings: Settings, changed: () => void): void {
  const toggle = (key: Switch, text: string) => {
    const box = el("input", { type: "checkbox", id: `show-${key}` });
    box.checked = settings[key];
    box.onchange = () => {
      settings[key] = box.checked;
      changed();
    };
    return el("label", { class: "check" }, box, el("span", { text }));
  };
  const size = el("input", {
    type: "range",
    id: "label-size",
    aria: { label: "Size of the labels" },
  });
  Object.assign(size, { min: "9", max: "24", step: "1" });
  size.value = String(settings.labelSize);
  const say = el("span", { class: "quiet percent", text: `${settings.labelSize} px` });
  size.oninput = () => {
    settings.labelSize = Number(size.value);
    say.textContent = `${size.value} px`;
    changed();
  };
  byId("settings").replaceChildren(
    toggle("labels", "Names of objects"),
    el("label", { class: "slider" }, el("span", { text: "Size" }), size, say),
    toggle("grid", "Grid lines in meters"),
    toggle("frames", "Frames"),
  );
}
