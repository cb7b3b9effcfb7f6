// All sessions of the folder: how each stands, sorted, filtered, searched; runs over those that are shown.
import { ask, chips, counted, h, say, tell } from "./dom.js";
import { folderCopied } from "./drop.js";
import { address } from "./main.js";

const wanted = { search: "", state: "all", by: "name", down: false };

function stateOf(row) {
  if (!row.found) return "not run";
  return row.found.fresh ? row.found.status : "changed since the run";
}

function ordered(rows) {
  const key = {
    name: (row) => row.name,
    date: (row) => row.date,
    state: stateOf,
    reason: (row) => row.found?.reason || "",
  };
  const by = key[wanted.by];
  return [...rows].sort((a, b) => (wanted.down ? -1 : 1) * by(a).localeCompare(by(b), undefined, { numeric: true }));
}

function folderChooser(found, page) {
  // another folder of this machine: one level at a time
  const place = h("div", { "aria-live": "polite" });
  const show = async (path) => {
    try {
      const told = await ask("folders", { folder: path });
      const go = (to, text) => h("button", { onclick: () => show(to), "aria-label": `Look into ${text}` }, text);
      place.replaceChildren(
        h("p", {}, told.folder),
        h(
          "div",
          { cls: "bar" },
          told.above ? go(told.above, "One up") : "",
          told.roots.filter((one) => one !== told.folder && one !== told.above).map((one) => go(one, one)),
          h("button", { cls: "main", "data-key": "open", onclick: () => openFolder(told.folder, page) }, "Open this folder"),
        ),
        h(
          "div",
          { cls: "bar" },
          told.folders.map((one) => go(`${told.folder}/${one}`, one)),
        ),
      );
    } catch (error) {
      say(error.message);
    }
  };
  return h(
    "details",
    { ontoggle: (event) => event.target.open && show(found.folder) },
    h("summary", { "data-key": "folder" }, "Another folder"),
    h("div", { cls: "bar" }, folderCopied(page)),
    place,
  );
}

export async function openFolder(path, page) {
  // the sessions of another folder; where it holds none, this one stays
  try {
    say("");
    await tell("open", { folder: path });
    if (location.hash === "#/" || !location.hash) await page.refresh();
    else location.hash = "#/";
  } catch (error) {
    say(error.message);
  }
}

export async function showArchive(main, page) {
  Object.assign(page, { name: "", revision: "", refresh: () => showArchive(main, page) });
  document.title = "biodance";
  const turn = page.turn,
    found = await ask("listed");
  if (turn !== page.turn) return;
  document.getElementById("folder").textContent = found.folder;
  const body = h("tbody"),
    count = h("p", { cls: "small", role: "status" });
  const states = ["all", ...new Set(found.rows.map(stateOf))];
  if (!states.includes(wanted.state)) wanted.state = "all";
  const shown = () =>
    ordered(
      found.rows.filter(
        (row) =>
          (wanted.state === "all" || stateOf(row) === wanted.state) &&
          row.name.toLowerCase().includes(wanted.search.toLowerCase()),
      ),
    );
  const draw = () => {
    const rows = shown();
    count.textContent = `${rows.length} of ${counted(found.rows.length, "session")}`;
    all.disabled = found.run?.state === "running" || !rows.some(isOpen);
    body.replaceChildren(
      ...rows.map((row) =>
        h(
          "tr",
          {},
          h("th", { scope: "row" }, h("a", { href: address(row.name, row.found ? "quality" : "trials") }, row.name)),
          h("td", { "data-label": "Date" }, row.date || "–"),
          h("td", { "data-label": "State" }, chips(row.found)),
          h("td", { "data-label": "First to be seen" }, row.found?.reason || ""),
        ),
      ),
    );
    for (const head of main.querySelectorAll("th[data-by]")) {
      const mine = head.dataset.by === wanted.by;
      head.setAttribute("aria-sort", mine ? (wanted.down ? "descending" : "ascending") : "none");
    }
  };
  const sorted = (by, text) =>
    h(
      "th",
      { scope: "col", "data-by": by },
      h(
        "button",
        {
          onclick: () => {
            Object.assign(wanted, { by, down: wanted.by === by && !wanted.down });
            draw();
          },
        },
        text,
      ),
    );
  const run = async (rows) => {
    try {
      page.run = (await tell("run", { names: rows.map((row) => row.name) })).run;
      await page.refresh();
    } catch (error) {
      say(error.message);
    }
  };
  const isOpen = (row) => !["done", "needs a person"].includes(stateOf(row)),
    all = h("button", { cls: "push", onclick: () => run(shown().filter(isOpen)) }, "Run those shown that are not done");
  main.replaceChildren(
    h("h1", {}, "Sessions"),
    h(
      "div",
      { cls: "bar" },
      h(
        "label",
        {},
        "Search ",
        h("input", {
          type: "search",
          value: wanted.search,
          oninput: (event) => {
            wanted.search = event.target.value;
            draw();
          },
        }),
      ),
      h(
        "label",
        {},
        "Show ",
        h(
          "select",
          {
            onchange: (event) => {
              wanted.state = event.target.value;
              draw();
            },
          },
          states.map((one) => h("option", { value: one, selected: one === wanted.state }, one)),
        ),
      ),
      all,
    ),
    h("p", { cls: "small" }, "Drop the folder of a session anywhere here: it is copied, run, and its page shown."),
    folderChooser(found, page),
    count,
    h(
      "table",
      { cls: "stack" },
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          sorted("name", "Session"),
          sorted("date", "Date"),
          sorted("state", "State"),
          sorted("reason", "First to be seen"),
        ),
      ),
      body,
    ),
    h("p", { cls: "small" }, `Results go to ${found.out}. biodance ${found.version}; for research use.`),
  );
  draw();
}
