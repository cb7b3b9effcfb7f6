// A form for what one person can and may do, and beside it the file that `biodance dance --limits` reads.
import { ask, download, h, say, tell } from "./dom.js";

const EACH = { right: "Right", left: "Left" };

function number(key, low, high, step, value, changed, label) {
  return h("input", {
    cls: "short",
    type: "number",
    min: low,
    max: high,
    step,
    value: value ?? "",
    "aria-label": label,
    "data-key": key,
    onchange: (event) => changed(event.target.value === "" ? undefined : Number(event.target.value)),
  });
}

function put(table, key, value) {
  if (value === undefined || value === "") delete table[key];
  else table[key] = value;
}

function fields(legend, ...children) {
  return h("fieldset", {}, h("legend", {}, legend), ...children);
}

function several(legend, key, choices, values, changed) {
  // a list of words, each a box to tick
  const chosen = () => Object.keys(choices).filter((one) => values[key]?.includes(one));
  const tick = (one) => (event) => {
    const now = new Set(chosen());
    if (event.target.checked) now.add(one);
    else now.delete(one);
    values[key] = Object.keys(choices).filter((word) => now.has(word));
    changed();
  };
  const box = (one) =>
    h("input", { type: "checkbox", checked: chosen().includes(one), "data-key": `${key} ${one}`, onchange: tick(one) });
  return fields(
    legend,
    h(
      "div",
      { cls: "bar" },
      Object.entries(choices).map(([one, words]) => h("label", {}, box(one), ` ${words}`)),
    ),
  );
}

function rows(caption, columns, made) {
  const head = columns.map((text) => h("th", { scope: "col" }, text));
  return h("table", { cls: "stack" }, h("caption", {}, caption), h("thead", {}, h("tr", {}, head)), h("tbody", {}, made));
}

function sidedRow(one, cell) {
  const name = h("th", { scope: "row" }, one.words, one.isb ? h("span", { cls: "small" }, ` (${one.isb})`) : null);
  const cells = one.sided
    ? Object.entries(EACH).map(([side, word]) => h("td", { "data-label": word }, cell(`${side}_${one.key}`, word)))
    : [h("td", { colspan: 2, "data-label": "Both" }, cell(one.key, ""))];
  return h("tr", {}, name, cells);
}

function strengthChoice(key, label, grades, table, changed) {
  const choices = ["", ...Object.keys(grades), ...[0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0].map(String)];
  const now = table[key] === undefined ? "" : String(table[key]);
  if (!choices.includes(now)) choices.push(now);
  const said = (one) => (one in grades ? `${one} of 5` : one ? `${Math.round(100 * one)} %` : "usual");
  const pick = (event) => {
    const value = event.target.value;
    put(table, key, value in grades || value === "" ? value : Number(value));
    changed();
  };
  return h(
    "select",
    { "aria-label": label, "data-key": `strength ${key}`, onchange: pick },
    choices.map((one) => h("option", { value: one, selected: one === now }, said(one))),
  );
}

function form(told, values, changed) {
  // what is asked, in the order in which somebody who treats a person thinks of it
  for (const key of ["at_most_deg", "weight_bearing", "strength"]) values[key] ??= {};
  const set = (table, key) => (value) => {
    put(table, key, value);
    changed();
  };
  const single = (key, text, low, high, step) =>
    h("label", {}, text, number(key, low, high, step, values[key], set(values, key), text));
  const share = values.weight_bearing;
  const percent = (side) => (value) => set(share, side)(value === undefined ? value : value / 100);
  const degrees = (one) =>
    sidedRow(one, (key, word) =>
      number(`deg ${key}`, 0, 180, 1, values.at_most_deg[key], set(values.at_most_deg, key), `${word} ${one.words}`),
    );
  const strong = (one) =>
    sidedRow(one, (key, word) =>
      strengthChoice(key, `${word} ${one.words}`, told.grades, values.strength, changed),
    );
  const text = (key, label, shown, read, lines) =>
    h(
      "label",
      { cls: "above" },
      label,
      h(lines ? "textarea" : "input", {
        rows: lines,
        "data-key": key,
        value: shown(values[key]),
        onchange: (event) => set(values, key)(read(event.target.value)),
      }),
    );
  const lines = (value) => value.split("\n").map((one) => one.trim()).filter(Boolean);
  return [
    text("reason", "Reason, in words; it stands on the cards", (value) => value || "", (value) => value.trim()),
    several("Cannot or may not", "cannot", told.cannot, values, changed),
    several("Hands that stay on a walking frame, a rail or bars", "hold_frame", EACH, values, changed),
    fields(
      "Weight bearing, % of the body weight; empty: all",
      h(
        "div",
        { cls: "fields" },
        Object.entries(EACH).map(([side, word]) => {
          const now = share[side] === undefined ? undefined : Math.round(100 * share[side]);
          return h("label", {}, `${word} leg`, number(`bears ${side}`, 0, 100, 1, now, percent(side), `${word} leg, %`));
        }),
      ),
    ),
    fields(
      "Pauses, speed, seat",
      h(
        "div",
        { cls: "fields" },
        single("rest_after_s", "Rest after so many s of dancing (heart, breath, pain)", 10, 600, 1),
        single("max_speed_deg_s", "No joint turns faster, degrees a second (spasticity)", 1, 720, 1),
        single("seat_height_m", "Seat of the stool, m", 0.3, 1.2, 0.01),
      ),
      text("care", "Who helps, when to stop (pain, dizziness): a sentence a line", (value) => (value || []).join("\n"), lines, 3),
    ),
    rows("How far a movement goes, degrees; empty: as usual", ["Movement", "Right", "Left"], told.movements.map(degrees)),
    rows("Strength", ["Muscles of", "Right", "Left"], told.strengths.map(strong)),
  ];
}

export async function showLimits(main, page) {
  Object.assign(page, { name: "", revision: "", refresh: null });
  document.title = "A person's limits - biodance";
  const turn = page.turn,
    told = await ask("form");
  if (turn !== page.turn) return;
  const asked = h("div"),
    file = h("pre", { cls: "wide", tabindex: 0, "aria-label": "The file", "data-key": "file" }),
    save = h("div", { cls: "bar" });
  const now = { template: "nobody", values: {}, asked: 0 };
  const changed = async () => {
    const mine = (now.asked += 1),
      body = { template: now.template, values: JSON.stringify(now.values) };
    try {
      const found = await tell("limits", body);
      if (mine !== now.asked) return;
      say("");
      file.textContent = found.text;
      save.replaceChildren(download({ format: "limits", ...body }, "Save person.toml"));
    } catch (error) {
      if (mine !== now.asked) return;
      say(error.message);
      save.replaceChildren();
    }
  };
  const begin = (template) => {
    Object.assign(now, { template, values: structuredClone(told.templates[template]) });
    asked.replaceChildren(...form(told, now.values, changed));
    return changed();
  };
  const choice = h(
    "select",
    { "data-key": "template", onchange: (event) => begin(event.target.value) },
    Object.keys(told.templates).map((name) => h("option", { value: name }, name.replace("hip_tep", "new hip"))),
  );
  main.replaceChildren(
    h("h1", {}, "What a person can and may do"),
    h("p", {}, "Every entry only takes away; what is empty stays as usual for sex, age, stature and mass."),
    h("div", { cls: "fields" }, h("label", {}, "Begin with", choice)),
    h("div", { cls: "two" }, asked, h("div", { cls: "sticky" }, save, file)),
  );
  await begin(now.template);
}
