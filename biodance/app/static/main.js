// The window: which page is shown (the address behind #), what runs, and whether another tab changed something.
import { showArchive } from "./archive.js";
import { ask, h, say, tell } from "./dom.js";
import { takeDrops } from "./drop.js";
import { showLimits } from "./limits.js";
import { showSession } from "./session.js";

const main = document.getElementById("main");
const page = { turn: 0, name: "", revision: "", refresh: null, run: null };
Object.assign(page, { queue: Promise.resolve(), busy: 0, waiting: new Set() }); // changes that are not answered yet

export function address(name, tab = "trials") {
  return name ? `#/${encodeURIComponent(name)}/${tab}` : "#/";
}

async function show() {
  page.turn += 1;
  const [, name, tab] = location.hash.split("/").map(decodeURIComponent);
  try {
    if (location.hash === "#limits") await showLimits(main, page);
    else if (name) await showSession(main, page, name, tab || "trials");
    else await showArchive(main, page);
  } catch (error) {
    main.replaceChildren(h("p", {}, error.message), h("p", {}, h("a", { href: "#/" }, "All sessions")));
    say(error.message);
  }
  look();
}

function showRun(run) {
  const place = document.getElementById("run"),
    key = run && `${run.state} ${run.done} ${run.doing} ${Math.round(run.seconds)}`;
  if (place.dataset.key === String(key)) return;
  place.dataset.key = String(key);
  if (!run) return place.replaceChildren();
  if (run.state === "running") {
    let stop = place.querySelector("button");
    stop =
      stop ||
      h(
        "button",
        {
          onclick: () =>
            tell("stop", {})
              .then(look)
              .catch((error) => say(error.message)),
        },
        "Stop",
      );
    const bar = h("progress", { max: run.names.length, "aria-label": "Sessions done" });
    if (run.names.length > 1) bar.value = run.done;
    const said = `${run.done} of ${run.names.length} done, ${Math.round(run.seconds)} s. ${run.doing}`;
    const told = h("span", { "aria-hidden": true }, said);
    if (place.querySelector("button")) {
      place.querySelector("span").textContent = said;
      if (run.names.length > 1) place.querySelector("progress").value = run.done;
    } else place.replaceChildren(bar, told, stop, h("span", { role: "status", cls: "visually-hidden" }, "Running"));
    return undefined;
  }
  const ended = { finished: "Finished", stopped: "Stopped; nothing of it is left", failed: "Failed" }[run.state];
  return place.replaceChildren(h("span", { role: "status" }, `${ended} after ${Math.round(run.seconds)} s.`));
}

async function look() {
  try {
    const mine = page.busy, // what a change of ours does is no other's doing
      about = page.name,
      found = await ask("state", about ? { name: about } : {});
    const before = page.run;
    page.run = found.run;
    showRun(found.run);
    if (found.run?.why && found.run.state !== "running" && before?.state !== found.run.state) say(found.run.why);
    const idle = !mine && !page.busy && about === page.name;
    if (idle && page.name && page.revision && found.revision !== page.revision) {
      say("session.toml was changed elsewhere, in another tab or an editor. It is shown as it is now.");
      page.revision = found.revision;
      await page.refresh?.();
    } else if (before?.state === "running" && found.run?.state !== "running") await page.refresh?.();
    if (document.getElementById("said").dataset.gone) {
      delete document.getElementById("said").dataset.gone;
      say("");
    }
    return true;
  } catch (error) {
    say(error.message);
    if (error.gone) document.getElementById("said").dataset.gone = "yes";
    return false;
  }
}

let passed = 0,
  looking = false;
setInterval(async () => {
  // every 1.5 s; while something runs, whose end an answer waits for, one question after the other
  passed += 1;
  if (looking || (passed % 5 && page.run?.state !== "running")) return;
  looking = true;
  while ((await look()) && page.run?.state === "running");
  looking = false;
}, 300);
takeDrops(page);
addEventListener("hashchange", () => {
  say("");
  show();
});
show();
