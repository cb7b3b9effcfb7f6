// One recording in time: forces of the plates, foot strikes and offs of the last run, and spans that are left out.
import { ask, h, number, put, say, words } from "./dom.js";
import { called, discard, EventEditor, isDraft, SIDES } from "./events.js";

const kept = { trial: "" };
const WHOLE = "no gait cycle from a foot's strike to its next, no squat, no rise and no jump";
const HIGH = 240,
  ROW = 16;

export async function showSteps(all) {
  const { panel, view, name, edit } = all;
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
    const at = h("input", { cls: "short", inputmode: "decimal", "aria-label": "Time of the event, in s" });
    const line = h("div"),
      chosen = h("div", { cls: "bar", "aria-live": "polite" });
    const changes = h("div", { "aria-live": "polite" });
    const redraw = (key) => {
      line.replaceChildren(
        timeLine(row, forces, editor, (a, b) => {
          at.value = a.toFixed(3);
          if (b - a < editor.frame) return;
          from.value = a.toFixed(3);
          to.value = b.toFixed(3);
        }),
      );
      if (key) line.querySelector(`[data-key="${CSS.escape(key)}"]`)?.focus();
    };
    const editor = new EventEditor(all, row, moved, forces.ends_s, redraw);
    line.addEventListener("focusin", () => {
      const one = editor.events.find((other) => editor.key(other) === document.activeElement.dataset.key);
      if (!one) return;
      at.value = one.time_s.toFixed(3);
      chosen.replaceChildren(
        `Chosen: ${called(one)} at ${number(one.time_s, 3)} s. `,
        h("button", { "data-key": "take out", onclick: () => editor.remove(one) }, "Take out"),
      );
    });
    redraw();
    place.replaceChildren(
      line,
      h(
        "p",
        { cls: "small" },
        "Curves: vertical force of each plate. Triangles: down a foot strikes, up it leaves; full by a plate, open by ",
        "the markers, with a black edge set by hand. Red left, blue right. Grey: left out. Drag a triangle to move it, ",
        "or choose it and press an arrow key (a frame) or Delete. Drag over the picture to choose a span.",
      ),
      chosen,
      byHand(all, row, editor, at, draw),
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
      changes,
      cycles(row, moved, add),
    );
    if (moved?.cycles.some((one) => one.kind === "gait") && !view.found.fresh) await showChanges(changes, name, row);
    return undefined;
  }
  await draw();
}

function cycles(row, moved, add) {
  // every repetition, to be switched off
  if (!moved) return h("p", {}, "Run the session to see its steps.");
  if (!moved.cycles.length) return h("p", {}, `It holds ${WHOLE}.`);
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

async function showChanges(place, name, row) {
  // the values of the last run beside those with the steps as they are set now
  place.replaceChildren(h("p", { cls: "small" }, "Working out what these steps change …"));
  try {
    const { rows } = await ask("strides", { name, trial: row.name });
    const line = (one) =>
      h(
        "tr",
        {},
        h("th", { scope: "row" }, words(one.quantity)),
        h("td", { "data-label": "Side" }, one.side),
        ...["before", "after"].map((when, k) =>
          h(
            "td",
            { cls: "n", "data-label": ["Last run", "As set now"][k] },
            one[when] === null ? "–" : `${number(one[when], 2)} ${one.unit}`,
          ),
        ),
        h("td", { cls: "n", "data-label": "Strides now" }, `${one.count}`),
      );
    const head = ["Value", "Side", "Last run", "As set now", "Strides now"];
    place.replaceChildren(
      h("h2", {}, "What the steps as set now change"),
      h(
        "table",
        { cls: "stack", "data-key": "changes" },
        h(
          "thead",
          {},
          h(
            "tr",
            {},
            head.map((one) => h("th", { scope: "col" }, one)),
          ),
        ),
        h("tbody", {}, rows.map(line)),
      ),
      h("p", { cls: "small" }, "Means, from the motion of the last run. Run again for margins, curves, moments and the report."),
    );
  } catch (error) {
    place.replaceChildren(h("p", { cls: "guess-word" }, error.message));
  }
}

function byHand({ view, name, edit }, row, editor, at, draw) {
  // events are added, those of a foot given back to the plates and markers, and what is not written yet is said
  const add = (side, down) => {
    const time = Number(at.value.replace(",", "."));
    return at.value && Number.isFinite(time)
      ? editor.add(side, down, time)
      : say("Give the time of the event in s, or press on the picture where it is.");
  };
  const sides = Object.keys(SIDES).filter((side) => row.events.some((one) => one.side === side));
  const without = (side) => {
    const kept = row.events.filter((one) => one.side !== side);
    const told = kept.map((one) => ({ side: one.side, kind: one.down ? "strike" : "off", time: one.time_s }));
    return edit([["trials", row.stem, "events"], told.length ? told : null]);
  };
  return h(
    "div",
    {},
    h(
      "div",
      { cls: "bar" },
      h("label", {}, "Add at ", at),
      "s",
      Object.keys(SIDES).flatMap((side) =>
        [true, false].map((down) => {
          const what = called({ side, down });
          return h("button", { "data-key": `add ${what}`, onclick: () => add(side, down) }, `Add ${what}`);
        }),
      ),
    ),
    isDraft({ view, name }, row)
      ? h(
          "p",
          { cls: "guess-word" },
          "Not in session.toml yet: add what is missing, or ",
          h(
            "button",
            {
              "data-key": "discard",
              onclick: () => {
                discard();
                say("");
                draw();
              },
            },
            "Discard these changes",
          ),
        )
      : "",
    sides.map((side) =>
      h(
        "p",
        {},
        `Strikes and offs of the ${side} foot are set by hand. `,
        h("button", { "data-key": `found ${side}`, onclick: () => without(side) }, "Use those found again"),
      ),
    ),
  );
}

function timeLine(row, forces, editor, onspan) {
  const wide = Math.min(1000, Math.max(340, innerWidth - 40)), // so that its letters are as large as others
    few = wide < 600 ? 4 : 10;
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
    const colour = ["#1b1b1b", "#6b6b6b", "#8a5a00", "#00694b"][k % 4];
    const pieces = one.time_s.map((t, i) =>
      one.force_n[i] === null ? null : `${x(t).toFixed(1)} ${y(one.force_n[i]).toFixed(1)}`,
    );
    const path = pieces.map((p, i) => (p === null ? "" : `${i && pieces[i - 1] !== null ? "L" : "M"}${p}`)).join("");
    parts.push(
      h("path", {
        d: path || "M0 0",
        fill: "none",
        stroke: colour,
        "stroke-width": 1.5,
      }),
    );
    parts.push(h("text", { x: 6, y: 16 + 14 * k, fill: colour }, one.name));
  });
  for (const one of editor.events)
    parts.push(
      h("line", {
        x1: x(one.time_s),
        x2: x(one.time_s),
        y1: 0,
        y2: HIGH,
        stroke: SIDES[one.side],
        "stroke-opacity": 0.35,
        "stroke-dasharray": one.down ? null : "4 3",
      }),
    );
  const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100].find((one) => (end - begin) / one <= few) || 200;
  for (let t = Math.ceil(begin / step) * step; t < end; t += step) {
    const at = { x: x(t), y: HIGH + 3 * ROW + 12, "text-anchor": x(t) < 12 ? "start" : "middle" };
    if (x(t) < wide - 24) parts.push(h("text", at, t.toFixed(step < 1 ? 1 : 0)));
  }
  parts.push(h("text", { x: wide - 4, y: HIGH + 3 * ROW + 12, "text-anchor": "end" }, "s"));
  parts.push(h("text", { x: wide - 70, y: 14 }, `${most.toFixed(0)} N`));
  const mark = h("rect", { y: 0, height: HIGH + 3 * ROW, width: 0, fill: "#f59e0b44" });
  const picture = h(
    "svg",
    {
      viewBox: `0 0 ${wide} ${HIGH + 3 * ROW + 18}`,
      role: "group",
      "aria-label":
        `Forces and steps of ${row.name}, ${begin.toFixed(2)} to ${end.toFixed(2)} s. ` +
        "The table below lists the cycles.",
    },
    parts,
    mark,
  );
  const timeAt = (event) => {
    const box = (picture.isConnected ? picture : document.querySelector("#panel svg")).getBoundingClientRect();
    return begin + Math.min(1, Math.max(0, (event.clientX - box.left) / box.width)) * (end - begin);
  };
  for (const one of editor.events)
    put(picture, editor.mark(one, x, HIGH + (one.side === "left" ? ROW : 2 * ROW), timeAt));
  let start = null;
  picture.addEventListener("pointerdown", (event) => {
    start = timeAt(event);
    onspan(start, start);
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
