// What the page that leads makes of pictures, without browser and clock: `bench_follow.py` asks.
//   node follow_pictures.mjs see BUNDLE         pictures of 192 x 192 RGBA bytes in, 17 points of (y, x, how sure) out
//   node follow_pictures.mjs grade TEMPLATES    {scene, when, points, width, height} in, what is known at the end out
// The program, kernels and weights are those of the page; only what draws and speaks is left out.
import fs from "node:fs";
import vm from "node:vm";

const [mode, folder] = process.argv.slice(2);
await { see, grade }[mode](folder);

async function see(bundle) {
  const world = { WebAssembly, performance, TextDecoder, setTimeout, clearTimeout, queueMicrotask, URL, Response,
    console, location: { href: "blob:" }, navigator: { userAgent: "", hardwareConcurrency: 1 }, atob, btoa };
  Object.assign(world, { self: world, importScripts: () => {}, WorkerGlobalScope: class {}, fetch: async () => null });
  let answer = null;
  world.postMessage = (message) => answer(message);
  vm.createContext(world);
  vm.runInContext(fs.readFileSync(`${bundle}/pose.js`, "utf8"), world);
  const ask = (data) => new Promise((resolve) => {
    answer = resolve;
    world.onmessage({ data });
  });
  const bytes = (name) => new Uint8Array(fs.readFileSync(`${bundle}/${name}`)).buffer;
  const topology = fs.readFileSync(`${bundle}/movenet.json`, "utf8");
  const first = await ask({ wasm: bytes("pose.wasm"), topology, weights: bytes("movenet.bin") });
  if (!first.ready) throw new Error(first.error);
  const size = 4 * 192 * 192;
  let rest = Buffer.alloc(0);
  for await (const chunk of process.stdin) {
    for (rest = Buffer.concat([rest, chunk]); rest.length >= size; rest = rest.subarray(size)) {
      const told = await ask({ pixels: new Uint8Array(rest.subarray(0, size)).buffer, tag: {} });
      process.stdout.write(Buffer.from(told.points.buffer));
    }
  }
}

function grade(templates) {
  const read = (name) => fs.readFileSync(`${templates}/${name}`, "utf8");
  const lent = (name) => read("feedback.js").match(new RegExp(`function ${name}\\([\\s\\S]*?\\n}\\n`))[0];
  const given = JSON.parse(fs.readFileSync(0, "utf8"));
  const thing = () => new Proxy({ style: { setProperty() {} }, dataset: {}, childNodes: [] }, {
    get: (own, name) => (name in own ? own[name] : () => thing()) });
  const things = {}, heard = {}, world = { given, things, thing, heard, Buffer, told: null };
  vm.createContext(world);
  vm.runInContext(`"use strict";
    const data = given.scene, cues = data.cues, by = (id) => things[id] ??= thing(), words = thing, run = thing;
    const document = { body: thing(), createElement: thing, hidden: true };
    const bytes = (text) => new Uint8Array(Buffer.from(text, "base64")).buffer;
    const addEventListener = (name, does) => (heard[name] ??= []).push(does), setInterval = thing;
    let second = -1, playing = true, stream = {};
    ${lent("moment")} ${lent("solve")} ${read("follow_body.js")} ${read("follow.js")}
    const shown = () => heard.shown.forEach((does) => does()), { width, height } = given;
    paused = true; // to the end, as the truth
    given.when.forEach((at, k) => {
      second = at;
      const points = given.points[k].flatMap(([x, y, sure]) => [y / width, x / width, sure]);
      take({ points, tag: { cut: { x: 0, y: 0, size: width }, width, height, at }, ms: 1 });
      shown();
    });
    for (second of [data.duration_s - 0.01, data.duration_s]) shown();
    told = known;`, world);
  process.stdout.write(JSON.stringify(world.told));
}
