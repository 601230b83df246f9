import "ol/ol.css";
import "./app.css";
import { App } from "./app";
import { byId } from "./dom";
import { EmbeddedSource } from "./embedded";
import { ServerSource } from "./server";
import type { DataSource, EmbeddedMap } from "./source";

function openSource(): DataSource {
  const blob = document.getElementById("hypermap-blob")?.textContent;
  return blob ? new EmbeddedSource(JSON.parse(blob) as EmbeddedMap) : new ServerSource();
}

async function open(source: DataSource): Promise<void> {
  const app = new App(source, await source.map());
  window.hypermapPage.view = app.view;
  window.hypermapPage.map = app.view.map;
  app.start();
}

const source = openSource();
const ready = Promise.resolve().then(() => open(source));
window.hypermapPage = { source, ready };
ready.catch((error: unknown) => {
  byId("banner").hidden = false;
  byId("banner").textContent = error instanceof Error ? error.message : String(error);
});

declare global {
  interface Window {
    /** For tests, which look at the map from outside. */
    hypermapPage: {
      source: DataSource;
      ready: Promise<void>;
      view?: App["view"];
      map?: App["view"]["map"];
    };
  }
}
