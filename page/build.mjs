// Builds the pages into src/hypermap/viewer/page: of a map (index.html, app.js, app.css), of a map
// being made (run.html, run.js, run.css), and the licences of what is bundled.
import { build } from "esbuild";
import { mkdir, readFile, readdir, writeFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const out = join(here, "..", "src", "hypermap", "viewer", "page");

const { metafile } = await build({
  absWorkingDir: here,
  entryPoints: { app: "src/main.ts", run: "src/run/main.ts" },
  outdir: out,
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "utf8",
  legalComments: "none",
  metafile: true,
});
await mkdir(out, { recursive: true });
await writeFile(join(out, "index.html"), await page("index.html"));
await writeFile(join(out, "run.html"), await page("run/index.html"));
await writeFile(join(out, "app.licenses.txt"), await licences(Object.values(metafile.outputs)));

/** A page, with what both share in its places. */
async function page(path) {
  let text = await readFile(join(here, "src", path), "utf8");
  for (const part of ["head", "mark"]) {
    const shared = await readFile(join(here, "src", "shared", `${part}.html`), "utf8");
    text = text.replace(`<!-- shared:${part} -->`, shared.trim());
  }
  return text;
}

/** The licence of each package of which something is in the bundle. */
async function licences(outputs) {
  const inputs = outputs.flatMap((output) =>
    Object.entries(output.inputs)
      .filter(([, { bytesInOutput }]) => bytesInOutput > 0)
      .map(([path]) => path),
  );
  const packages = new Set(
    inputs.map((path) => path.match(/^node_modules\/((?:@[^/]+\/)?[^/]+)/)?.[1]).filter(Boolean),
  );
  const texts = [];
  for (const name of [...packages].sort()) {
    const folder = join(here, "node_modules", name);
    const { version, license } = JSON.parse(await readFile(join(folder, "package.json"), "utf8"));
    const file = (await readdir(folder)).find((file) => /^licen[cs]e/i.test(file));
    if (!file) throw new Error(`${name} comes without the text of its licence`);
    const text = (await readFile(join(folder, file), "utf8")).trim();
    texts.push(`${name} ${version} (${license})\n\n${text}\n`);
  }
  return texts.join(`\n${"-".repeat(80)}\n\n`);
}
