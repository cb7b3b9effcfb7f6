// One recording in time: forces of the plates, foot strikes and offs of the last run, and spans that are left out.
import { ask, h, number, put, say } from "./dom.js";

const SIDES = { left: "#b3261e", right: "#0058a3" };
const kept = { trial: "" };
const HIGH = 240,
  ROW = 16;

export async function showSteps({ panel, view, name, edit }) {
  const trials = view.trials.filter((row) => row.name);
  if (!trials.some((row) => row.name === kept.trial))
    kept.trial = (trials.find((row) => row.role !== "static") || trials[0]).name;
  const results = view.found ? await ask("results", { name }).catch(() => null) : null;
  const place = h("div");
  put(
    panel,
    h(
      "div",
      { cls: "bar" },
      h(
        "label",
        {},
        "Recording ",
        h(
          "select",
          {
            "data-key": "steps",
            onchange: (event) => {
              kept.trial = event.target.value;
              draw();
            },
          },
          trials.map((row) => h("option", { value: row.name, selected: row.name === kept.trial }, row.name)),
        ),
      ),
      view.found && !view.found.fresh
        ? h("span", { cls: "guess-word" }, "Steps are of the last run; run again to see them change.")
        : "",
    ),
    place,
  );

  async function draw() {
    const row = trials.find((one) => one.name === kept.trial);
    let forces = null;
    try {
      forces = await ask("forces", { name, trial: kept.trial });
    } catch (error) {
      return say(error.message);
    }
    const moved = results?.moved.find((one) => one.trial === kept.trial);
    const from = h("input", { cls: "short", inputmode: "decimal", "aria-label": "Leave out from, in s" });
    const to = h("input", { cls: "short", inputmode: "decimal", "aria-label": "Leave out to, in s" });
    const leave = (spans) => edit([["trials", row.stem, "leave_out"], spans.length ? spans : null]);
    const add = (a, b, side) =>
      leave([...row.leave_out, [Number(a.toFixed(3)), Number(b.toFixed(3)), ...(side in SIDES ? [side] : [])]]);
    const line = timeLine(row, forces, moved, (a, b) => {
      from.value = a.toFixed(3);
      to.value = b.toFixed(3);
    });
    place.replaceChildren(
      line,
      h(
        "p",
        { cls: "small" },
        "Curves: vertical force of each plate. Triangles: down a foot strikes, up it leaves; full by a plate, open by ",
        "the markers. Red left, blue right. Grey: left out. Drag over the picture to choose a span.",
      ),
      h(
        "div",
        { cls: "bar" },
        h("label", {}, "Leave out from ", from),
        h("label", {}, "to ", to),
        "s",
        h(
          "button",
          {
            "data-key": "leave",
            onclick: () => {
              const [a, b] = [from, to].map((one) => Number(one.value.replace(",", ".")));
              return from.value && to.value && Number.isFinite(a) && Number.isFinite(b)
                ? add(a, b)
                : say("Give from and to in s, or drag over the picture.");
            },
          },
          "Leave out",
        ),
      ),
      row.leave_out.length
        ? h(
            "ul",
            {},
            row.leave_out.map((span, k) =>
              h(
                "li",
                {},
                `${number(span[0], 2)} to ${number(span[1], 2)} s is left out: ` +
                  `${span[2] ? `no ${span[2]} step` : "no forces, no step"}. `,
                h("button", { onclick: () => leave(row.leave_out.filter((_, i) => i !== k)) }, "Use it again"),
              ),
            ),
          )
        : "",
      cycles(row, moved, add),
    );
    return undefined;
  }
  await draw();
}

function cycles(row, moved, add) {
  // every repetition, to be switched off
  if (!moved) return h("p", {}, "Run the session to see its steps.");
  if (!moved.cycles.length) return h("p", {}, "No step, squat or rise was found in it.");
  return h(
    "table",
    { cls: "stack" },
    h(
      "thead",
      {},
      h(
        "tr",
        {},
        ["Cycle", "Side", "From", "Foot off, lowest", "To", ""].map((one) =>
          h("th", { scope: "col" }, one || h("span", { cls: "visually-hidden" }, "Switch off")),
        ),
      ),
    ),
    h(
      "tbody",
      {},
      moved.cycles.map((one, k) => {
        const out = row.leave_out.some(
          ([a, b, side]) => (!side || side === one.side) && Math.min(b, one.end_s) - Math.max(a, one.start_s) > 0.02,
        );
        return h(
          "tr",
          { cls: out ? "off" : "" },
          h("th", { scope: "row" }, `${one.kind.replaceAll("_", " ")} ${k + 1}`),
          h("td", { "data-label": "Side" }, one.side),
          h("td", { cls: "n", "data-label": "From" }, `${number(one.start_s, 2)} s`),
          h(
            "td",
            { cls: "n", "data-label": "Foot off, lowest" },
            one.off_s === null ? "–" : `${number(one.off_s, 2)} s`,
          ),
          h("td", { cls: "n", "data-label": "To" }, `${number(one.end_s, 2)} s`),
          h(
            "td",
            {},
            out
              ? "left out"
              : h(
                  "button",
                  {
                    "data-key": `cycle ${k}`,
                    onclick: () => add(one.start_s, one.end_s, one.side),
                    "aria-label": `Switch off ${one.kind} ${k + 1}`,
                  },
                  "Switch off",
                ),
          ),
        );
      }),
    ),
  );
}

function timeLine(row, forces, moved, onspan) {
  const wide = Math.min(1000, Math.max(340, innerWidth - 40)), // so that its letters are as large as others
    ticks = wide < 600 ? 4 : 10;
  const [begin, end] = forces.ends_s,
    most = Math.max(100, ...forces.plates.flatMap((one) => one.force_n.filter((f) => f !== null)));
  const x = (t) => ((t - begin) / Math.max(end - begin, 1e-9)) * wide,
    y = (f) => HIGH - (Math.max(f, 0) / most) * (HIGH - 20);
  const parts = row.leave_out.map(([a, b, side]) => {
    const from = x(Math.max(a, begin)),
      width = Math.max(1, x(Math.min(b, end)) - from),
      fill = side ? `${SIDES[side]}33` : "#00000022"; // of one foot: its row of triangles alone
    if (!side) return h("rect", { x: from, y: 0, width, height: HIGH + 3 * ROW, fill });
    return h("rect", { x: from, y: HIGH + (side === "left" ? ROW : 2 * ROW) - 8, width, height: ROW, fill });
  });
  forces.plates.forEach((one, k) => {
    const pieces = one.time_s.map((t, i) =>
      one.force_n[i] === null ? null : `${x(t).toFixed(1)} ${y(one.force_n[i]).toFixed(1)}`,
    );
    const path = pieces.map((p, i) => (p === null ? "" : `${i && pieces[i - 1] !== null ? "L" : "M"}${p}`)).join("");
    parts.push(
      h("path", {
        d: path || "M0 0",
        fill: "none",
        stroke: ["#1b1b1b", "#6b6b6b", "#8a5a00", "#00694b"][k % 4],
        "stroke-width": 1.5,
      }),
    );
    parts.push(h("text", { x: 6, y: 16 + 14 * k, fill: "#1b1b1b" }, one.name));
  });
  for (const one of moved?.events || []) {
    const at = x(one.time_s),
      row_y = HIGH + (one.side === "left" ? ROW : 2 * ROW),
      up = one.down ? 1 : -1;
    parts.push(
      h(
        "path",
        {
          d: `M${at} ${row_y + 5 * up}l-5 ${-10 * up}h10z`,
          stroke: SIDES[one.side],
          "stroke-width": 1.5,
          fill: one.source === "force" ? SIDES[one.side] : "#fff",
        },
        h(
          "title",
          {},
          `${one.side} foot ${one.down ? "strikes" : "leaves"} at ${one.time_s.toFixed(3)} s, ` +
            `by the ${one.source === "force" ? "plates" : "markers"}`,
        ),
      ),
    );
    parts.push(
      h("line", {
        x1: at,
        x2: at,
        y1: 0,
        y2: HIGH,
        stroke: SIDES[one.side],
        "stroke-opacity": 0.35,
        "stroke-dasharray": one.down ? null : "4 3",
      }),
    );
  }
  for (let k = 0; k <= ticks; k++) {
    const t = begin + (k / ticks) * (end - begin);
    parts.push(h("text", { x: Math.min(x(t), wide - 34), y: HIGH + 3 * ROW + 12 }, `${t.toFixed(2)}`));
  }
  parts.push(h("text", { x: wide - 70, y: 14 }, `${most.toFixed(0)} N`));
  const mark = h("rect", { y: 0, height: HIGH + 3 * ROW, width: 0, fill: "#f59e0b44" });
  const picture = h(
    "svg",
    {
      viewBox: `0 0 ${wide} ${HIGH + 3 * ROW + 18}`,
      role: "img",
      "aria-label":
        `Forces and steps of ${row.name}, ${begin.toFixed(2)} to ${end.toFixed(2)} s. ` +
        "The table below lists the cycles.",
    },
    parts,
    mark,
  );
  const timeAt = (event) => {
    const box = picture.getBoundingClientRect();
    return begin + Math.min(1, Math.max(0, (event.clientX - box.left) / box.width)) * (end - begin);
  };
  let start = null;
  picture.addEventListener("pointerdown", (event) => {
    start = timeAt(event);
    picture.setPointerCapture(event.pointerId);
  });
  picture.addEventListener("pointermove", (event) => {
    if (start === null) return;
    const [a, b] = [start, timeAt(event)].sort((p, q) => p - q);
    mark.setAttribute("x", x(a));
    mark.setAttribute("width", x(b) - x(a));
    onspan(a, b);
  });
  picture.addEventListener("pointerup", () => {
    start = null;
  });
  return picture;
}
