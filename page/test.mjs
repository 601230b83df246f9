// Runs the tests in test/, which need no browser: bundled, since Node.js 20 reads no TypeScript.
import { build } from "esbuild";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const folder = mkdtempSync(join(tmpdir(), "hypermap-page-"));
const tests = readdirSync("test").filter((name) => name.endsWith(".test.ts"));
let status = 1;
try {
  await build({
    entryPoints: tests.map((name) => join("test", name)),
    outdir: folder,
    outExtension: { ".js": ".mjs" },
    bundle: true,
    platform: "node",
    format: "esm",
    logLevel: "error",
  });
  const files = readdirSync(folder).map((name) => join(folder, name));
  const reporter = "--test-reporter=dot";
  status = spawnSync(process.execPath, ["--test", reporter, ...files], { stdio: "inherit" }).status;
} finally {
  rmSync(folder, { recursive: true });
}
process.exitCode = status ?? 1;
