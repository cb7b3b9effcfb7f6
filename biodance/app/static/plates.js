// The plates as they lie on the floor, with the way of the pressure over them; corners, type, channels, foot and use.
import { ask, chip, h, number, put, say } from "./dom.js";

const COLOURS = ["#0058a3", "#b3261e", "#00694b", "#7a3e9d", "#8a5a00", "#3d5a5b"];

function floor(view, forces) {
  // seen from above, x to the right, y up the page
  const laid = view.plates.filter((one) => one.corners_m);
  const all = laid.flatMap((one) => one.corners_m).map(([x, y]) => [x, y]);
  const low = [0, 1].map((k) => Math.min(0, ...all.map((p) => p[k])) - 0.15);
  const high = [0, 1].map((k) => Math.max(0, ...all.map((p) => p[k])) + 0.15);
  const size = [high[0] - low[0], high[1] - low[1]],
    scale = Math.min(700, Math.max(340, innerWidth - 60)) / Math.max(...size);
  const at = ([x, y]) => [((x - low[0]) * scale).toFixed(1), ((high[1] - y) * scale).toFixed(1)];
  const parts = [];
  const [ox, oy] = at([0, 0]);
  parts.push(h("path", { d: `M${ox} ${oy}h40m-40 0v-40`, stroke: "#555", fill: "none", "stroke-width": 2 }));
  parts.push(
    h("text", { x: Number(ox) + 42, y: Number(oy) + 4 }, "x"),
    h("text", { x: Number(ox) - 4, y: oy - 44 }, "y"),
  );
  view.plates.forEach((one, k) => {
    if (!one.corners_m) return;
    const colour = COLOURS[k % COLOURS.length],
      corners = one.corners_m.map(at);
    parts.push(
      h("polygon", {
        points: corners.map((p) => p.join(",")).join(" "),
        fill: colour,
        "fill-opacity": 0.08,
        stroke: colour,
        "stroke-width": 2,
        "stroke-dasharray": one.placed ? null : "6 4",
      }),
    );
    const middle = [0, 1].map((i) => one.corners_m.reduce((sum, p) => sum + p[i], 0) / 4);
    one.corners_m.forEach((point, corner) => {
      const [x, y] = at([0, 1].map((i) => point[i] + 0.1 * (middle[i] - point[i]))); // inside, where no neighbour is
      parts.push(h("text", { x, y: Number(y) + 4, "text-anchor": "middle" }, String(corner + 1)));
    });
    const [x, y] = at(middle);
    parts.push(h("text", { x, y, "text-anchor": "middle", "font-weight": "bold" }, one.name));
    const path = forces?.plates.find((plate) => plate.name === one.name)?.cop_m || [];
    path.map(at).forEach(([cx, cy]) => parts.push(h("circle", { cx, cy, r: 1.6, fill: colour })));
  });
  return h(
    "svg",
    {
      viewBox: `0 0 ${(size[0] * scale).toFixed(0)} ${(size[1] * scale).toFixed(0)}`,
      role: "img",
      "aria-label": `${laid.length} plates seen from above, with their corners numbered and the way of the pressure`,
    },
    parts,
  );
}

function plateForm(one, edit) {
  const where = ["plates", one.name];
  const set = (key, value) => edit([[...where, key], value]);
  if (!one.corners_m) {
    return h(
      "fieldset",
      {},
      h("legend", {}, one.name),
      h("p", {}, one.use ? "No recording has it." : "Switched off."),
      h("button", { onclick: () => set("use", null) }, `Use ${one.name} again`),
    );
  }
  const corner = (k, i) =>
    h("input", {
      cls: "short",
      inputmode: "decimal",
      value: String(one.corners_m[k][i]),
      "data-key": `${one.name} ${k} ${i}`,
      "aria-label": `${one.name}, corner ${k + 1}, ${"xyz"[i]} in m`,
      onchange: (event) => {
        const corners = one.corners_m.map((point) => [...point]);
        corners[k][i] = Number(event.target.value.replace(",", "."));
        if (!Number.isFinite(corners[k][i])) return say(`${event.target.value} is no number.`);
        return set("corners_m", corners);
      },
    });
  const loads = one.loads.map((row) =>
    h("li", {}, `${row.trial}: most ${number(row.most_n, 0)} N, mean ${number(row.mean_n, 0)} N`),
  );
  return h(
    "fieldset",
    {},
    h("legend", {}, `${one.name} `, one.placed ? null : chip("place not in the file", "look")),
    h(
      "div",
      { cls: "fields" },
      h(
        "label",
        {},
        "Foot on it",
        h(
          "select",
          { "data-key": `${one.name} foot`, onchange: (event) => set("foot", event.target.value || null) },
          [
            ["", "as the markers show"],
            ["left", "left"],
            ["right", "right"],
          ].map(([value, text]) => h("option", { value, selected: value === one.foot }, text)),
        ),
      ),
      h(
        "label",
        {},
        "Type",
        h("input", {
          cls: "short",
          inputmode: "numeric",
          value: String(one.type || ""),
          "data-key": `${one.name} type`,
          onchange: (event) => set("type", event.target.value ? Number(event.target.value) : null),
        }),
      ),
      h(
        "label",
        {},
        "Channels",
        h("input", {
          value: one.channels.join(", "),
          "data-key": `${one.name} channels`,
          onchange: (event) => set("channels", channels(event.target.value)),
        }),
      ),
      h("button", { onclick: () => set("use", false) }, `Switch ${one.name} off`),
    ),
    h(
      "details",
      {},
      h("summary", {}, "Corners, loads, what was decided"),
      h(
        "table",
        { cls: "corners" },
        h("caption", {}, "m, lab frame, z up; in the order +x+y, -x+y, -x-y, +x-y of the plate's own axes"),
        h(
          "tbody",
          {},
          one.corners_m.map((_, k) =>
            h(
              "tr",
              {},
              h("th", { scope: "row" }, String(k + 1)),
              [0, 1, 2].map((i) => h("td", {}, corner(k, i))),
            ),
          ),
        ),
      ),
      h(
        "ul",
        { cls: "small" },
        loads,
        one.decisions.map((text) => h("li", {}, text)),
      ),
    ),
  );
}

function channels(text) {
  // names, or numbers from 1
  const listed = text
    .split(",")
    .map((one) => one.trim())
    .filter(Boolean);
  return listed.length ? listed.map((one) => (/^\d+$/.test(one) ? Number(one) : one)) : null;
}

export function showPlates(panel, view, edit) {
  put(panel, h("h2", {}, "Plates"));
  if (!view.plates.length) return put(panel, h("p", {}, "No recording has a force plate."));
  const drawn = h("div", {}, floor(view, null));
  const loaded = view.trials.filter((row) => row.name && row.plates.length);
  const pressure = async (trial) => {
    if (!trial) return drawn.replaceChildren(floor(view, null));
    try {
      return drawn.replaceChildren(floor(view, await ask("forces", { name: view.name, trial })));
    } catch (error) {
      return say(error.message);
    }
  };
  const menu = h(
    "label",
    {},
    "Way of the pressure in ",
    h(
      "select",
      { onchange: (event) => pressure(event.target.value) },
      h("option", { value: "" }, "no recording"),
      loaded.map((row) => h("option", { value: row.name }, row.name)),
    ),
  );
  put(
    panel,
    h(
      "div",
      { cls: "two" },
      h("div", { cls: "sticky" }, h("div", { cls: "bar" }, menu), drawn),
      h(
        "div",
        {},
        view.plates.map((one) => plateForm(one, edit)),
      ),
    ),
  );
  const first = loaded.find((row) => row.role !== "static") || loaded[0];
  if (first) {
    menu.querySelector("select").value = first.name;
    pressure(first.name);
  }
}
