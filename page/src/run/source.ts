/** The run behind `hypermap map --view`: its steps, pictures and news through HTTP. */

import { ask } from "../server";
import type { Changes, RunUpdate, Observation } from "./steps";

export interface RunInfo {
  /** Id of this run, as another may get the same address. */
  id: string;
  /** What is mapped. */
  recording: string;
  /** The map that is made. */
  output: string;
}

export interface StepAnswer {
  observation: Observation;
  objects: Changes;
}

export class RunSource {
  private id = "";

  async run(): Promise<RunInfo> {
    const info = (await (await ask("api/run", {})).json()) as RunInfo;
    this.id = info.id;
    return info;
  }

  /** A step; its objects as the difference to those of another one. */
  async step(number: number, since: number | null): Promise<StepAnswer> {
    const query = since === null ? "" : `?since=${since}`;
    return (await ask(`api/steps/${number}${query}`, {})).json() as Promise<StepAnswer>;
  }

  picture(number: number): Promise<HTMLImageElement> {
    return loaded(`api/pictures/${number}.jpg?run=${this.id}`);
  }

  grid(number: number): Promise<HTMLImageElement> {
    return loaded(`api/grids/${number}.png?run=${this.id}`);
  }

  /** Calls back with all news; with null while the server does not answer. */
  watch(heard: (news: RunUpdate | null) => void): void {
    const events = new EventSource("api/events");
    events.onmessage = (event: MessageEvent<string>) => heard(JSON.parse(event.data) as RunUpdate);
    events.onerror = () => heard(null);
  }
}

async function loaded(url: string): Promise<HTMLImageElement> {
  const image = new Image();
  image.src = url;
  await image.decode();
  return image;
}
