// One session: its name, what can be undone and run, and its tabs.
import { ask, chips, h, put, say, tell } from "./dom.js";
import { showBody, showFiles, showGait, showQuality } from "./results.js";
import { showMarkers } from "./markers.js";
import { address } from "./main.js";
import { showSteps } from "./steps.js";
import { showTrials } from "./trials.js";

const TABS = {
  trials: showTrials,
  markers: showMarkers,
  steps: showSteps,
  quality: showQuality,
  gait: showGait,
  body: showBody,
  files: showFiles,
};
const NEEDS_SESSION = ["trials", "markers", "steps"];

export async function showSession(main, page, name, tab) {
  const turn = page.turn;
  let view = await ask("session", { name });
  if (turn !== page.turn) return; // somebody went on meanwhile
  document.title = `${name} · biodance`;
  Object.assign(page, { name, revision: view.revision });
  page.refresh = async () => showSession(main, page, name, tab);
  const changed = (path, more = {}) => {
    // one after the other: who is faster than the answer loses nothing, unless both change the same key
    const keys = (more.changes || []).map(([key]) => key.join("/")),
      seen = page.revision,
      apart = keys.length && !keys.some((key) => page.waiting.has(key));
    keys.forEach((key) => page.waiting.add(key));
    page.busy += 1;
    page.queue = page.queue
      .then(() => change(path, more, apart ? page.revision : seen))
      .finally(() => {
        page.busy -= 1;
        keys.forEach((key) => page.waiting.delete(key));
      });
    return page.queue;
  };
  const change = async (path, more, revision) => {
    // a change of session.toml; what is then shown is what was read again
    try {
      say("");
      const found = await tell(path, { name, revision, ...more });
      if (page.name === name) page.revision = found.revision;
      if (turn === page.turn) await draw((view = found));
      else if (page.name === name) await page.refresh(); // somebody went to another tab meanwhile
      return true;
    } catch (error) {
      say(error.message);
      if (error.status === 409) await page.refresh();
      else await draw(view);
      return false;
    }
  };
  const edit = (...changes) => changed("edit", { changes });
  const run = async () => {
    say(""); // of the run before
    try {
      await page.queue; // what was changed just now is a part of it
      page.run = (await tell("run", { names: [name] })).run;
      await page.refresh();
    } catch (error) {
      say(error.message);
    }
  };
  const panel = h("div", { role: "tabpanel", id: "panel", "aria-labelledby": `tab-${tab}`, tabindex: "0" });
  const move = (event) => {
    // arrows go from tab to tab, as in every tab list
    const names = Object.keys(TABS),
      step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    page.focus = true;
    location.hash = address(name, names[(names.indexOf(tab) + step + names.length) % names.length]);
  };

  async function draw(now) {
    const kept = document.activeElement?.dataset?.key,
      running = page.run?.state === "running";
    const whole = now.found?.fresh && now.found.tables; // there is nothing that a run would change
    main.replaceChildren(
      h(
        "div",
        { cls: "bar" },
        h("h1", {}, name),
        ...chips(now.found),
        h("span", { cls: "push" }),
        h("button", { disabled: !now.undo, onclick: () => changed("undo"), "data-key": "undo" }, "Undo"),
        h("button", { disabled: !now.redo, onclick: () => changed("redo"), "data-key": "redo" }, "Redo"),
        h(
          "button",
          {
            cls: "main",
            disabled: running || whole,
            onclick: run,
            "data-key": "run",
            title: whole ? "The results are of what you see: nothing changed since." : null,
          },
          running ? "Running …" : whole ? "Results are up to date" : "Run",
        ),
      ),
      h(
        "div",
        { role: "tablist", "aria-label": "Parts of the session", onkeydown: move },
        Object.keys(TABS).map((one) =>
          h(
            "button",
            {
              role: "tab",
              id: `tab-${one}`,
              "aria-selected": String(one === tab),
              "aria-controls": "panel",
              tabindex: one === tab ? "0" : "-1",
              onclick: () => {
                location.hash = address(name, one);
              },
            },
            one[0].toUpperCase() + one.slice(1),
          ),
        ),
      ),
      panel,
    );
    if (page.focus) {
      page.focus = false;
      document.getElementById(`tab-${tab}`).focus();
    }
    const unread = now.why && h("p", { cls: "verdict fail" }, now.why);
    panel.replaceChildren();
    if (unread && NEEDS_SESSION.includes(tab)) {
      put(
        panel,
        unread,
        h("p", {}, "Correct session.toml here, or the folder, and it is read again."),
        textEditor(now, changed),
      );
    } else {
      const loading = put(panel, h("p", { cls: "small" }, "Loading …")).lastChild;
      await TABS[tab]({ panel, view: now, name, edit, changed, page });
      loading.remove();
    }
    if (kept) main.querySelector(`[data-key="${CSS.escape(kept)}"]`)?.focus();
  }
  await draw(view);
}

export function textEditor(view, changed) {
  const text = h("textarea", { rows: 16, spellcheck: "false", "aria-label": "session.toml" });
  text.value = view.text;
  return h(
    "div",
    {},
    text,
    h(
      "div",
      { cls: "bar" },
      h("button", { onclick: () => changed("text", { text: text.value }) }, "Save session.toml"),
    ),
  );
}
