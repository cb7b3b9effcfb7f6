// What the last run found: verdict and reasons, the pages that it drew, its files; and what acceptance would change.
import { ask, chip, download, h, number, put, say, tell, words } from "./dom.js";
import { openFolder } from "./archive.js";
import { address } from "./main.js";
import { showMarker } from "./markers.js";
import { textEditor } from "./session.js";

const CHANNELS = ["Fx", "Fy", "Fz", "Mx", "My", "Mz"];

function hasRun({ panel, view, name, page }) {
  // whether it was run, and what is to be known of that run
  const running = page.run?.state === "running" && page.run.names.includes(name);
  if (running) put(panel, h("p", { cls: "guess-word" }, "It runs now. What it finds comes here by itself."));
  if (!view.found) {
    if (!running) put(panel, h("p", {}, "This session has not been run yet. Press Run."));
    return false;
  }
  if (!view.found.fresh && !running)
    put(panel, h("p", { cls: "guess-word" }, "Something changed since this run. Run again to see what it changes."));
  return true;
}

async function resultsOf(all) {
  if (!hasRun(all)) return null;
  try {
    return await ask("results", { name: all.name });
  } catch (error) {
    put(all.panel, h("p", { cls: "warn" }, all.view.found.reason || error.message));
    return null;
  }
}

function showPage(all, part, title) {
  // part of the page that the last run drew; why there is none
  if (!hasRun(all)) return;
  const { reason, page } = all.view.found;
  put(all.panel, page ? frame(all.name, part, title) : h("p", { cls: "warn" }, reason || "The last run drew no page."));
}

function frame(name, part, title) {
  return h("iframe", {
    src: `/page?${new URLSearchParams({ name, part })}`,
    title,
    sandbox: "allow-scripts allow-popups allow-downloads",
  });
}

export const showGait = (all) => showPage(all, "gait", "What moved: curves and values of the last run");

export const showBody = (all) => showPage(all, "body", "The body of the last run, its replay and masses");

function place({ about, trial }) {
  // where a sentence belongs: what is looked at, and the recording
  const what = words(["", "file", "diagnosis"].includes(about) ? "" : about);
  return [what && what[0].toUpperCase() + what.slice(1), trial].filter(Boolean).join(", ") || "Session";
}

export async function showQuality(all) {
  const { panel, name } = all,
    found = await resultsOf(all);
  if (!found) return;
  const [first, ...rest] = found.attention;
  const acts = rest.filter((one) => one.level !== "note"),
    notes = rest.filter((one) => one.level === "note");
  const list = (rows) =>
    h(
      "ul",
      {},
      rows.map((one) => h("li", {}, h("strong", {}, `${place(one)}: `), one.text)),
    );
  put(
    panel,
    first
      ? h("p", { cls: `verdict ${first.level}` }, first.text)
      : h("p", { cls: "verdict note" }, "Nothing needs a person."),
    found.reasons.length
      ? h(
          "p",
          {},
          "Reasons: ",
          found.reasons.map((one) => [chip(words(one)), " "]),
        )
      : "",
    acts.length ? [h("h2", {}, "What needs a person"), list(acts)] : "",
    notes.length
      ? h("details", {}, h("summary", {}, `Notes that need no action: ${notes.length}`), list(notes))
      : "",
    h("h2", {}, "Findings"),
    found.findings.length ? findings(found.findings, all) : h("p", {}, "No cause was found."),
    acceptance(all, found),
    h("h2", {}, "Seconds that this rests on"),
    judged(found.judged),
    h(
      "details",
      {},
      h("summary", {}, "All checks by trial"),
      frame(name, "quality", "Checks and trials of the last run"),
    ),
  );
}

function judged(rows) {
  return h(
    "table",
    { cls: "stack" },
    h(
      "thead",
      {},
      h(
        "tr",
        {},
        ["Recording", "Judged", "Left out", "Why not"].map((one) => h("th", { scope: "col" }, one)),
      ),
    ),
    h(
      "tbody",
      {},
      rows.map((one) =>
        h(
          "tr",
          {},
          h("th", { scope: "row" }, one.trial),
          h("td", { cls: "n", "data-label": "Judged" }, `${number(one.seconds, 2)} s`),
          h(
            "td",
            { "data-label": "Left out" },
            Object.entries(one.left_out || {})
              .map(([why, s]) => `${words(why)} ${number(s, 2)} s`)
              .join(", ") || "nothing",
          ),
          h("td", { "data-label": one.why_not ? "Why not" : null }, one.why_not || ""),
        ),
      ),
    ),
  );
}

const SHOWN = { m: [1000, "mm", 0], rad: [180 / Math.PI, "°", 1], s: [1000, "ms", 1], 1: [100, "%", 1] };

const size = (one) =>
  // each parameter as people say it, ± half of its 95 % interval
  Object.entries(one.parameters || {})
    .map(([key, { value, sd, unit }]) => {
      const [factor, called, digits] = SHOWN[unit] || [1, unit || "", 2];
      const said = (some, scale) =>
        [some]
          .flat()
          .map((x) => number(x === null ? null : scale * x, digits).replace("-", "−"))
          .join(", ");
      const known = [sd].flat().some((x) => Number.isFinite(x));
      return `${words(key)} ${said(value, factor)}${known ? ` ± ${said(sd, 1.96 * factor)}` : ""} ${called}`.trim();
    })
    .join("; ");

function shownMarkers(one, { name, view }) {
  // where a finding is about labels, the way to where they are exchanged
  const labels = view.markers?.labels.map((row) => row.label) || [];
  return (one.target || "")
    .split("/")
    .filter((label) => labels.includes(label))
    .map((label) => [
      h("a", { href: address(name, "markers"), onclick: () => showMarker(label) }, `Show ${label}`),
      " ",
    ]);
}

function findings(rows, all) {
  const place = h("div", { "aria-live": "polite" }),
    able = rows.filter((one) => one.session_entry);
  const button = (some, text) =>
    h(
      "button",
      { onclick: () => correction(place, some, all), "data-key": `correct ${some.map((one) => one.target).join(" ")}` },
      text,
    );
  return [
    h(
      "table",
      { cls: "stack" },
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          ["Cause", "Size", "Probability", "What to do"].map((one) => h("th", { scope: "col" }, one)),
        ),
      ),
      h(
        "tbody",
        {},
        rows.map((one) =>
          h(
            "tr",
            {},
            h("th", { scope: "row" }, `${words(one.effect)} ${words(one.target || "")}`),
            h("td", { "data-label": "Size" }, size(one)),
            h(
              "td",
              { cls: "n", "data-label": "Probability" },
              one.probability === null || one.probability === undefined ? "–" : `${number(100 * one.probability, 0)} %`,
            ),
            h(
              "td",
              { "data-label": "What to do" },
              one.advice || "",
              " ",
              shownMarkers(one, all),
              one.session_entry ? button([one], corrects(one)) : "",
            ),
          ),
        ),
      ),
    ),
    able.length > 1 ? h("div", { cls: "bar" }, button(able, `Correct all ${able.length} …`)) : "",
    place,
  ];
}

function corrects(one) {
  // what the button beside a finding does
  const [first, last] = (one.target || "").split("/"),
    where = one.trials?.length ? one.trials.join(", ") : "all recordings";
  if (one.session_entry === "exchange") return `Exchange ${first} and ${last} in ${where} …`;
  if (one.session_entry === "channels") return `Exchange the channels of ${first} and ${last} …`;
  return "Take the mass that the plates weighed …";
}

async function correction(place, some, { name, edit, page }) {
  // what session.toml would say, before and after first; then it is written and the session run again
  place.replaceChildren(h("p", {}, "Working out before and after …"));
  try {
    const told = await tell("correction", { name, findings: some.map((one) => `${one.effect} ${one.target}`) });
    const write = async () => {
      if (!(await edit(...told.changes))) return;
      page.run = (await tell("run", { names: [name] })).run;
      await page.refresh();
    };
    place.replaceChildren(
      residuals(told.residuals),
      h(
        "p",
        { cls: "small" },
        "What session.toml would say: ",
        told.changes.map(([keys, value]) => [h("code", {}, `${keys.join(".")} = ${JSON.stringify(value)}`), " "]),
        "(Undo takes it back; your recordings stay as they are).",
      ),
      h(
        "button",
        { cls: "main", "data-key": "write", onclick: () => write().catch((error) => say(error.message)) },
        "Write this and run again",
      ),
    );
  } catch (error) {
    say(error.message);
    place.replaceChildren();
  }
}

function residuals(rows) {
  // what plates and simulation differ by, and the markers from the body, before and after
  if (!rows.length) return "";
  const kinds = [...CHANNELS, "Markers (mm)"];
  const line = (one, when) =>
    h(
      "tr",
      {},
      h("th", { scope: "row" }, one.trial),
      h("td", { "data-label": "When" }, when),
      one[when].map((x, k) => h("td", { cls: "n", "data-label": kinds[k] }, number(x, 1))),
    );
  return h(
    "table",
    { cls: "stack compared" },
    h(
      "caption",
      {},
      "What plates and simulation differ by (RMS; N, N·m), and markers and body, as it is and corrected",
    ),
    h(
      "thead",
      {},
      h(
        "tr",
        {},
        ["Recording", "When", ...kinds].map((one) => h("th", { scope: "col" }, one)),
      ),
    ),
    h(
      "tbody",
      {},
      rows.flatMap((one) => [line(one, "before"), line(one, "after")]),
    ),
  );
}

function acceptance({ name, page }, found) {
  // before and after first; only then can it be kept
  if (!found.findings.length) return "";
  const place = h("div", { "aria-live": "polite" });
  let corrected = false;
  const keep = async () => {
    try {
      const { folder } = await tell("keep", { name });
      place.replaceChildren(
        h("p", {}, `Kept in ${folder}. Your recordings are as they were.`),
        corrected
          ? h("button", { "data-key": "corrected", onclick: () => openFolder(`${folder}/corrected`, page) }, "Open the corrected session")
          : "",
      );
    } catch (error) {
      say(error.message);
    }
  };
  const look = async () => {
    place.replaceChildren(h("p", {}, "Working out before and after …"));
    try {
      const told = await tell("accept", { name });
      corrected = told.written.some((one) => one.file.startsWith("corrected/"));
      place.replaceChildren(
        residuals(told.residuals),
        told.written.length
          ? h(
              "div",
              {},
              h("h3", {}, "What would be written"),
              h(
                "ul",
                {},
                told.written.map((one) => h("li", {}, `${one.file}: ${one.what}`)),
              ),
            )
          : h("p", {}, "There is nothing to accept: nothing would be written."),
        told.not_applied.length
          ? h(
              "ul",
              { cls: "small" },
              told.not_applied.map((one) => h("li", {}, `Not applied: ${one.cause}, ${one.why}.`)),
            )
          : "",
        told.written.length ? h("button", { cls: "main", onclick: keep }, "Accept: keep these files") : "",
      );
    } catch (error) {
      say(error.message);
      place.replaceChildren();
    }
  };
  return h(
    "div",
    {},
    h(
      "div",
      { cls: "bar" },
      h("button", { onclick: look, "data-key": "accept" }, "Accept all, in copies … show before and after"),
    ),
    place,
  );
}

export async function showFiles(all) {
  const { panel, view, name, changed } = all,
    found = await resultsOf(all);
  if (found) {
    const trials = found.trials.filter((one) => one.status !== "refused").map((one) => one.name);
    const trial = h(
      "select",
      { "aria-label": "Recording to export", onchange: () => links() },
      trials.map((one) => h("option", { value: one }, one)),
    );
    const offered = h("div", { cls: "bar" });
    const links = () =>
      offered.replaceChildren(
        ...found.exports.map((one) =>
          download(
            { name, format: one.format, ...(one.of_trial ? { trial: trial.value } : {}) },
            one.format.toUpperCase(),
          ),
        ),
      );
    links();
    put(
      panel,
      h("h2", {}, "Results"),
      h(
        "div",
        { cls: "bar" },
        h(
          "a",
          { cls: "button", href: `/page?${new URLSearchParams({ name })}`, target: "_blank", rel: "noopener" },
          "Open the whole page (to print, PDF)",
        ),
        download({ name, format: "file", file: "report.html" }, "HTML"),
        found.tables
          ? [download({ name, format: "xlsx" }, "Excel"), download({ name, format: "csv" }, "CSV")]
          : h("span", { cls: "small" }, "Run again for Excel and CSV."),
      ),
      h("h3", {}, "For other programs"),
      h("div", { cls: "bar" }, h("label", {}, "C3D, TRC and MOT of ", trial)),
      offered,
      h(
        "details",
        {},
        h("summary", {}, `All ${found.files.length} files, in ${found.folder}`),
        h(
          "ul",
          {},
          found.files.map((file) =>
            h(
              "li",
              {},
              h(
                "a",
                { href: `/download?${new URLSearchParams({ name, format: "file", file })}`, download: true },
                file,
              ),
            ),
          ),
        ),
      ),
    );
  }
  put(
    panel,
    h("h2", {}, "session.toml"),
    h(
      "p",
      { cls: "small" },
      `${view.folder}/session.toml: all that this window changes. It is checked before it is saved; Undo goes back.`,
    ),
    textEditor(view, changed),
  );
}
