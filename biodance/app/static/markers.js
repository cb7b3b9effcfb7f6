// The labels and what each marks; two exchanged, in a trial or a span of it; one dropped; a click in 3-D finds its row.
import { ask, h, number, put, say, words } from "./dom.js";
import { markerScene } from "./scene.js";

const BY = {
  map: "session.toml",
  set: "the marker set",
  name: "guessed: its name says so",
  posture: "guessed: it stands there",
  nobody: "not used",
};
const kept = { trial: "", label: "" };

export function showMarker(label) {
  kept.label = label;
}

export async function showMarkers({ panel, view, edit }) {
  const found = view.markers,
    trials = view.trials.filter((row) => row.name && row.markers);
  if (!trials.length) return put(panel, h("p", {}, "No recording has markers."));
  if (!trials.some((row) => row.name === kept.trial))
    kept.trial = (trials.find((row) => row.role !== "static") || trials[0]).name;
  const place = h("div"),
    rows = new Map(),
    detail = h("div", { "aria-live": "polite" });
  let scene = null,
    data = null;

  const map = (changes) => {
    // the whole map, as it is with the changes: what is written is what is seen
    const whole = Object.fromEntries(found.labels.filter((row) => row.place).map((row) => [row.label, row.place]));
    for (const [label, to] of Object.entries(changes)) {
      if (to) whole[label] = to;
      else delete whole[label];
    }
    return edit([["markers", "file"], null], [["markers", "map"], whole]);
  };
  const menu = (row) => {
    const one = h(
      "select",
      {
        "aria-label": `What ${row.label} marks`,
        "data-key": `map ${row.label}`,
        onfocus: () => fill(one, row),
        onpointerdown: () => fill(one, row),
        onchange: () => map({ [row.label]: one.value }),
      },
      h("option", { value: row.place, selected: true }, row.place ? words(row.place) : "–"),
    );
    return one;
  };
  const fill = (one, row) => {
    // 60 places in 40 menus are made when one is opened
    if (one.options.length > 1) return;
    const group = (label, names) =>
      h(
        "optgroup",
        { label },
        names.filter((name) => name !== row.place).map((name) => h("option", { value: name }, words(name))),
      );
    one.append(
      h("option", { value: "" }, "not used"),
      group("Landmarks", found.landmarks),
      group("On a segment", view.segments),
    );
  };
  const body = h(
    "tbody",
    {},
    found.labels.map((row) => {
      const guessed = row.by === "name" || row.by === "posture";
      const tr = h(
        "tr",
        { cls: row.place ? "" : "off" },
        h(
          "th",
          { scope: "row" },
          h("button", { onclick: () => choose(row.label), "aria-label": `Show ${row.label}` }, row.label),
        ),
        h("td", { cls: guessed ? "guess" : "" }, menu(row)),
        h("td", { cls: guessed ? "guess-word" : "small", "data-label": "Known by" }, BY[row.by]),
        h(
          "td",
          { cls: "n", "data-label": "Not seen" },
          row.gaps_percent ? `${number(row.gaps_percent, 1)} %` : "none",
        ),
      );
      rows.set(row.label, tr);
      return tr;
    }),
  );

  function choose(label) {
    kept.label = label;
    for (const [name, tr] of rows) tr.classList.toggle("chosen", name === label);
    rows.get(label)?.scrollIntoView({ block: "nearest" });
    scene?.choose(label);
    detail.replaceChildren(label ? about(label) : "");
  }

  function about(label) {
    // what can be done with the chosen marker
    const gaps = data?.gaps?.[label] || [],
      filled = data?.filled?.[label] || [];
    const row = view.trials.find((one) => one.name === kept.trial);
    const others = found.labels.map((one) => one.label).filter((one) => one !== label);
    const twin = label.replace(/^([LR])/i, (side) => ({ L: "R", R: "L", l: "r", r: "l" })[side]);
    const other = h(
      "select",
      { "aria-label": `Marker to exchange ${label} with` },
      others.map((one) => h("option", { value: one, selected: one === twin }, one)),
    );
    const from = h("input", { cls: "short", inputmode: "decimal", placeholder: "start", "aria-label": "From, in s" });
    const to = h("input", { cls: "short", inputmode: "decimal", placeholder: "end", "aria-label": "To, in s" });
    const here = (field) =>
      h(
        "button",
        {
          onclick: () => {
            field.value = scene.time().toFixed(3);
          },
          "aria-label": `now: ${field.getAttribute("aria-label")}`,
        },
        "now",
      );
    const exchange = (stems) => {
      const span =
        from.value || to.value ? [Number(from.value || 0), Number(to.value || row.start_s + row.seconds)] : [];
      if (span.some((one) => !Number.isFinite(one))) return say("From and to are times in s.");
      return edit(
        ...stems.map((one) => [
          ["trials", one.stem, "exchange"],
          [...one.exchange, [label, other.value, ...span]],
        ]),
      );
    };
    const first = gaps
      .slice(0, 8)
      .map(([a, b]) => h("button", { onclick: () => scene.go(a) }, `${a.toFixed(2)}–${b.toFixed(2)} s`));
    return h(
      "fieldset",
      {},
      h("legend", {}, label),
      h(
        "p",
        { cls: "small" },
        gaps.length
          ? `${gaps.length} gaps in ${kept.trial}, ${filled.length} spans would be filled. `
          : `No gap in ${kept.trial}. `,
        first,
      ),
      h(
        "div",
        { cls: "bar" },
        h("label", {}, "Exchange with ", other),
        from,
        here(from),
        to,
        here(to),
        h("button", { onclick: () => exchange([row]), "data-key": "exchange" }, `In ${kept.trial}`),
        h(
          "button",
          { onclick: () => exchange(trials), disabled: Boolean(from.value || to.value) },
          "In all recordings",
        ),
      ),
      h(
        "div",
        { cls: "bar" },
        h(
          "button",
          {
            onclick: () =>
              edit([
                ["markers", "drop"],
                [...(found.dropped || []), label],
              ]),
          },
          `Do not use ${label}`,
        ),
      ),
    );
  }

  async function showTrial() {
    try {
      data = await ask("markers", { name: view.name, trial: kept.trial });
      if (!data.frames) return place.replaceChildren(h("p", {}, "No marker was seen in it."));
      scene = await markerScene(data, { chosen: kept.label, onchoose: choose });
      place.replaceChildren(scene.element);
      choose(found.labels.some((row) => row.label === kept.label) ? kept.label : "");
    } catch (error) {
      say(error.message);
    }
    return undefined;
  }

  const exchanged = view.trials.flatMap((row) =>
    row.exchange.map((one, k) =>
      h(
        "li",
        {},
        `${row.stem}: ${one[0]} and ${one[1]} exchanged${one.length > 2 ? ` from ${one[2]} to ${one[3]} s` : ""} `,
        h(
          "button",
          {
            onclick: () =>
              edit([
                ["trials", row.stem, "exchange"],
                row.exchange.length > 1 ? row.exchange.filter((_, i) => i !== k) : null,
              ]),
          },
          "Take back",
        ),
      ),
    ),
  );
  const dropped = (found.dropped || []).map((label) =>
    h(
      "li",
      {},
      `${label} is not used `,
      h(
        "button",
        {
          onclick: () =>
            edit([
              ["markers", "drop"],
              found.dropped.length > 1 ? found.dropped.filter((one) => one !== label) : null,
            ]),
        },
        "Use it again",
      ),
    ),
  );
  const worn = found.set ? `Marker set: ${found.set}.` : "No marker set is known.";
  put(
    panel,
    h(
      "div",
      { cls: "bar" },
      h("p", {}, worn),
      found.guessed
        ? h("button", { onclick: () => map({}), "data-key": "acceptmap" }, "Accept the guessed map shown in orange")
        : null,
    ),
    found.doubts.length
      ? h(
          "ul",
          { cls: "warn" },
          found.doubts.map((one) => h("li", {}, one)),
        )
      : "",
    exchanged.length + dropped.length ? h("ul", {}, exchanged, dropped) : "",
    h(
      "div",
      { cls: "two" },
      h(
        "div",
        { cls: "sticky" },
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
                onchange: (event) => {
                  kept.trial = event.target.value;
                  showTrial();
                },
              },
              trials.map((row) => h("option", { value: row.name, selected: row.name === kept.trial }, row.name)),
            ),
          ),
        ),
        place,
        detail,
      ),
      h(
        "div",
        { cls: "list", tabindex: "0", role: "region", "aria-label": "Labels" },
        h(
          "table",
          { cls: "stack" },
          h(
            "thead",
            {},
            h(
              "tr",
              {},
              ["Label", "Marks", "Known by", "Not seen"].map((one) => h("th", { scope: "col" }, one)),
            ),
          ),
          body,
        ),
      ),
    ),
  );
  await showTrial();
  return undefined;
}
