/** How the panels lie over the map. */

import { byId } from "./dom";
import type { Insets } from "./plane";

/** Phones, and narrow windows: panels lie below each other. */
export const NARROW = window.matchMedia("(max-width: 760px)");

export function toggleSidebar(open?: boolean): void {
  document.body.classList.toggle("sidebar-open", open);
}

/** What the panels cover of the map [pixels]. */
export function insets(): Insets {
  const shown = (id: string) => (byId(id).hidden ? null : byId(id).getBoundingClientRect());
  const panel = shown("panel");
  if (NARROW.matches) {
    const bar = shown("timebar");
    const foot = bar ? window.innerHeight - bar.top : 56;
    return { top: 64, right: 0, bottom: Math.max(foot, panel?.height ?? 0), left: 0 };
  }
  const side = shown("sidebar");
  const bar = shown("timebar");
  return {
    top: 64,
    right: panel ? window.innerWidth - panel.left : 0,
    bottom: bar ? window.innerHeight - bar.top : 56,
    left: side ? side.right : 0,
  };
}
