// Who was measured, what every recording is for, and the plates on the floor. What was guessed is orange until somebody
// says so in session.toml.
import { chip, counted, h, number, put, words } from "./dom.js";
import { showPlates } from "./plates.js";

const LIMBS = ["right", "left"].flatMap((side) =>
  ["thigh", "shank", "foot", "upper_arm", "forearm_hand"].map((part) => `${side}_${part}`),
);
const ROLES = {
  static: "static: stands still, scales the body",
  fit: "fit: movement to learn from",
  validate: "validate: kept to test with",
  check: "check: looked at only",
  skip: "skip: not used",
};

const DIGITS = { mass_kg: 2, height_m: 3, age: 1 };

function toNumber(text) {
  // null for an empty field; a decimal comma is taken, other text goes to the server as it is
  const plain = text.trim().replace(",", ".");
  if (plain === "") return null;
  return Number.isFinite(Number(plain)) ? Number(plain) : text;
}

function subject(view, edit) {
  const person = view.subject;
  const field = (key, text) => {
    const one = person[key],
      shown = one.value === null ? "" : String(Number(one.value.toFixed(DIGITS[key])));
    return h(
      "label",
      { cls: one.guessed ? "guess-word" : "" },
      text,
      one.guessed ? " · guessed" : "",
      h(
        "span",
        { cls: one.guessed ? "guess" : "" },
        h("input", {
          cls: "short",
          inputmode: "decimal",
          value: shown,
          "data-key": key,
          placeholder: "not known",
          onchange: (event) => edit([["subject", key], toNumber(event.target.value)]),
        }),
      ),
    );
  };
  const sex = h(
    "label",
    { cls: person.sex.guessed ? "guess-word" : "" },
    "Sex",
    person.sex.guessed ? " · guessed" : "",
    h(
      "span",
      { cls: person.sex.guessed ? "guess" : "" },
      h(
        "select",
        { "data-key": "sex", onchange: (event) => edit([["subject", "sex"], event.target.value]) },
        [
          ["F", "female"],
          ["M", "male"],
        ].map(([value, text]) => h("option", { value, selected: person.sex.value === value }, text)),
      ),
    ),
  );
  const prosthesis = h(
    "label",
    {},
    "Prosthesis begins with",
    h(
      "select",
      {
        "data-key": "prosthesis",
        onchange: (event) => edit([["subject", "prosthesis"], event.target.value || null]),
      },
      h("option", { value: "" }, "none"),
      LIMBS.map((one) => h("option", { value: one, selected: person.prosthesis === one }, words(one))),
    ),
  );
  return h(
    "fieldset",
    {},
    h("legend", {}, `Subject ${person.name}`),
    h(
      "div",
      { cls: "fields" },
      field("mass_kg", "Mass (kg)"),
      field("height_m", "Stature (m)"),
      sex,
      field("age", "Age (years)"),
      prosthesis,
    ),
    devices(view, edit),
  );
}

function devices(view, edit) {
  // what is worn beside the body: kg by segment
  const worn = Object.entries(view.subject.devices),
    segment = h(
      "select",
      { "aria-label": "Segment of the device" },
      view.segments.map((one) => h("option", { value: one }, words(one))),
    );
  const mass = h("input", {
    cls: "short",
    inputmode: "decimal",
    "aria-label": "Mass of the device in kg",
    placeholder: "kg",
  });
  return h(
    "div",
    { cls: "bar" },
    h("span", {}, "Devices worn:"),
    worn.length
      ? worn.map(([one, kg]) =>
          h(
            "span",
            { cls: "bar" },
            chip(`${words(one)} ${kg} kg`),
            h(
              "button",
              { onclick: () => edit([["devices", one], null]), "aria-label": `Remove the device on ${words(one)}` },
              "Remove",
            ),
          ),
        )
      : h("span", { cls: "small" }, "none"),
    segment,
    mass,
    h("button", { onclick: () => edit([["devices", segment.value], toNumber(mass.value)]) }, "Add"),
  );
}

function trialRow(row, view, edit) {
  const menu = h(
    "select",
    {
      "aria-label": `Role of ${row.stem}`,
      "data-key": `role ${row.stem}`,
      onchange: (event) => edit([["trials", row.stem, "role"], event.target.value]),
    },
    view.roles.map((role) => h("option", { value: role, selected: role === row.role }, ROLES[role] || role)),
  );
  if (!row.role) menu.prepend(h("option", { value: "", selected: true }, "–"));
  const parts = [
    row.exchange.length ? `${row.exchange.length} exchanged` : "",
    row.leave_out.length ? `${row.leave_out.length} left out` : "",
  ]
    .filter(Boolean)
    .join(", ");
  const moves = row.role === "static" && row.travels_m;
  return h(
    "tr",
    { cls: row.role === "skip" || row.why ? "off" : "" },
    h("th", { scope: "row" }, row.stem),
    h(
      "td",
      { "data-label": "Role", cls: row.told ? "" : "guess" },
      menu,
      row.told ? null : h("span", { cls: "guess-word" }, " guessed"),
    ),
    h(
      "td",
      { cls: "n", "data-label": "Time" },
      !row.name ? "–" : row.seconds > 0 ? `${number(row.seconds, 2)} s at ${number(row.rate_hz, 0)} Hz` : "1 frame",
    ),
    h("td", { "data-label": "Markers" }, row.name ? String(row.markers) : "–"),
    h("td", { "data-label": "Plates" }, row.name ? row.plates.join(", ") || "none" : "–"),
    h(
      "td",
      { "data-label": row.why || moves || parts || row.warnings?.length ? "To be seen" : null },
      row.why ? h("span", { cls: "warn" }, row.why) : null,
      moves
        ? h("span", { cls: "warn" }, `Nobody stands still in it: markers travel ${number(row.travels_m, 2)} m. `)
        : null,
      parts,
      row.name && row.warnings.length
        ? h(
            "details",
            {},
            h("summary", {}, counted(row.warnings.length, "warning")),
            h(
              "ul",
              {},
              row.warnings.map((one) => h("li", {}, one)),
            ),
          )
        : null,
    ),
  );
}

export function showTrials({ panel, view, edit }) {
  const open = view.trials.filter((row) => !row.told && row.role),
    sex = view.subject.sex;
  const guesses = open.map((row) => [["trials", row.stem, "role"], row.role]);
  if (sex.guessed) guesses.push([["subject", "sex"], sex.value]);
  for (const key of ["mass_kg", "height_m"]) {
    const { guessed, value } = view.subject[key];
    if (guessed && value !== null) guesses.push([["subject", key], Number(value.toFixed(DIGITS[key]))]);
  }
  const notes = view.notes.filter((one) => one);
  put(
    panel,
    subject(view, edit),
    h("h2", {}, "Recordings"),
    h(
      "div",
      { cls: "bar" },
      h(
        "button",
        { disabled: !guesses.length, onclick: () => edit(...guesses), "data-key": "accept" },
        guesses.length ? `Accept the ${counted(guesses.length, "guess", "guesses")} shown in orange` : "Nothing is guessed",
      ),
    ),
    h(
      "table",
      { cls: "stack" },
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          ["Recording", "Role", "Time", "Markers", "Plates", "To be seen"].map((one) =>
            h("th", { scope: "col" }, one),
          ),
        ),
      ),
      h(
        "tbody",
        {},
        view.trials.map((row) => trialRow(row, view, edit)),
      ),
    ),
    Object.keys(view.refused).length
      ? h(
          "p",
          { cls: "warn" },
          `Not read: ${Object.entries(view.refused)
            .map(([file, why]) => `${file} (${why})`)
            .join(" ")}`,
        )
      : "",
  );
  showPlates(panel, view, edit);
  put(
    panel,
    h(
      "details",
      {},
      h("summary", {}, `What was decided when it was read (${notes.length})`),
      h(
        "ul",
        { cls: "small" },
        notes.map((one) => h("li", {}, one)),
      ),
    ),
  );
}
