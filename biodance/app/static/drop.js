// Folders dropped on the window, or chosen on another disk: they are copied beside the results, opened and run.
import { answered, h, reached, say, tell } from "./dom.js";
import { address } from "./main.js";

const read = (reader) => new Promise((done, failed) => reader.readEntries(done, failed));

async function filesIn(entry, path = "") {
  // [path, file] of all files below an entry of a drop
  if (entry.isFile) return [[`${path}${entry.name}`, await new Promise((done, failed) => entry.file(done, failed))]];
  const reader = entry.createReader(),
    found = [];
  for (let some = await read(reader); some.length; some = await read(reader)) found.push(...some);
  const below = await Promise.all(found.map((one) => filesIn(one, `${path}${entry.name}/`)));
  return below.flat();
}

const wanted = ([path, file]) =>
  // neither hidden files nor films, which are large and tell biodance nothing
  !path.split("/").some((part) => part.startsWith(".")) && !file.type.startsWith("video/");

async function send(name, files) {
  const told = files.map(([path, file]) => [path, file.size]),
    megabytes = told.reduce((sum, [, size]) => sum + size, 0) / 1e6;
  say(`Copying ${name}: ${files.length} files, ${megabytes.toFixed(1)} MB …`);
  const head = JSON.stringify({ name, files: told });
  const body = new Blob([`${head}\n`, ...files.map(([, file]) => file)]);
  const headers = { "Content-Type": "application/octet-stream" };
  return answered(await reached("/api/drop", { method: "POST", headers, body }));
}

async function takeIn(files, page) {
  // by folders; files without one are a session named as the first of them. One session alone is run at once.
  const some = files.filter(wanted),
    folders = new Map();
  for (const [path, file] of some) {
    const [top, ...rest] = path.split("/"),
      name = rest.length ? top : some.find(([one]) => !one.includes("/"))[0].replace(/\.[^.]*$/, "");
    folders.set(name, [...(folders.get(name) || []), [rest.length ? rest.join("/") : top, file]]);
  }
  if (!folders.size) return say("Nothing of that can be read: drop the folder of a session, or its recordings.");
  try {
    const names = [];
    for (const [name, inside] of folders) names.push(...(await send(name, inside)).names);
    say("");
    page.name = ""; // what was shown belongs to the folder before
    if (names.length === 1) page.run = (await tell("run", { names })).run;
    const next = names.length === 1 ? address(names[0], "gait") : "#/";
    if (location.hash === next) await page.refresh();
    else location.hash = next;
  } catch (error) {
    say(error.message);
  }
  return undefined;
}

export function takeDrops(page) {
  // wherever on the page; what is dragged within the page (a triangle, a mark) carries no files
  const files = (event) => event.dataTransfer?.types.includes("Files");
  // a page of results in its frame would take the drop for itself, and nobody would answer it
  const over = (yes) => document.body.classList.toggle("dragged", yes);
  addEventListener("dragenter", (event) => files(event) && over(true));
  addEventListener("dragleave", (event) => event.relatedTarget || over(false)); // it left the window
  addEventListener("dragover", (event) => files(event) && event.preventDefault());
  addEventListener("drop", async (event) => {
    if (!files(event)) return;
    event.preventDefault();
    over(false);
    const entries = [...event.dataTransfer.items].map((one) => one.webkitGetAsEntry()).filter(Boolean);
    const found = await Promise.all(entries.map((one) => filesIn(one)));
    await takeIn(found.flat(), page);
  });
}

export function folderCopied(page) {
  // the same by keyboard, for a folder that the list below does not reach, as on a memory stick
  const input = h("input", {
    type: "file",
    webkitdirectory: true,
    "data-key": "copied",
    onchange: () => takeIn([...input.files].map((one) => [one.webkitRelativePath, one]), page),
  });
  return h("label", {}, "Copy a folder of another disk: ", input);
}
