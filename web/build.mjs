// Writes what follows a person into the folder that is named: the worker, its kernels, the weights, and the notices.
import { build } from "esbuild";
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url)), out = process.argv[2];
const modules = join(here, "node_modules");
mkdirSync(out, { recursive: true });

const made = await build({
  entryPoints: [join(here, "pose.js")], outfile: join(out, "pose.js"), bundle: true, minify: true, format: "iife",
  target: "es2022", charset: "ascii", legalComments: "none", metafile: true, logLevel: "error",
  external: ["node-fetch", "fs", "path", "os", "crypto", "util", "worker_threads", "perf_hooks", "string_decoder"],
  define: { "process.env.NODE_ENV": '"production"' },
});
for (const [from, to] of [
  ["@tensorflow/tfjs-backend-wasm/dist/tfjs-backend-wasm-simd.wasm", "pose.wasm"],
  ["@vladmandic/human/models/movenet-lightning.json", "movenet.json"],
  ["@vladmandic/human/models/movenet-lightning.bin", "movenet.bin"],
]) copyFileSync(join(modules, from), join(out, to));

const inside = Object.keys(made.metafile.inputs).map((path) => path.match(/node_modules\/((?:@[^/]+\/)?[^/]+)/)?.[1]);
const used = [...new Set([...inside.filter(Boolean), "@vladmandic/human"])].sort();
const notices = used.map((name) => {
  const { version, license, author } = JSON.parse(readFileSync(join(modules, name, "package.json"), "utf8"));
  const file = ["LICENSE", "LICENSE.md", "LICENSE.txt"].find((one) => {
    try { return readFileSync(join(modules, name, one)); } catch { return false; }
  });
  const text = file ? readFileSync(join(modules, name, file), "utf8").trim() : "";
  const by = typeof author === "string" ? author : author?.name ?? (name.startsWith("@tensorflow/") ? "Google LLC" : "");
  return `${name} ${version}, ${license}${by ? `, ${by}` : ""}\n${text && license !== "Apache-2.0" ? `\n${text}\n` : ""}`;
});
const head = "What follows a person in the page that leads is made of these works of others.\n\n"
  + "MoveNet Lightning (weights; Google LLC, Apache-2.0), as the npm package @vladmandic/human carries them.\n";
const apache = readFileSync(join(here, "..", "LICENSE"), "utf8").trim();
writeFileSync(join(out, "NOTICES.txt"), [head, ...notices, apache].join(`\n${"-".repeat(80)}\n`) + "\n");
