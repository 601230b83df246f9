import "ol/ol.css";
import "../app.css";
import "./run.css";
import { byId } from "../dom";
import { RunPage } from "./app";
import { RunSource } from "./source";

async function open(): Promise<void> {
  const source = new RunSource();
  const page = new RunPage(source, await source.run());
  window.hypermapRun = page;
  page.start();
}

open().catch((error: unknown) => {
  byId("banner").hidden = false;
  byId("banner").textContent = error instanceof Error ? error.message : String(error);
});

declare global {
  interface Window {
    /** For tests, which look at the page from outside. */
    hypermapRun?: RunPage;
  }
}
