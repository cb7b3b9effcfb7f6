// The log of this visit, which the laboratory reads (`biodance identify --dance`), and progress over visits whose logs
// are given. Nothing is kept by the browser: several people may dance on one computer.
let begun = null;
const spent = cues.map(() => ({ times: 0, held: 0 }));
addEventListener("danced", ({ detail: { phase, cue, spent: s } }) => {
  begun ??= new Date();
  if (phase === "hold" && !left_out.has(cue)) {
    spent[cue].times ||= 1;
    spent[cue].held += pausing ? 0 : s;
  }
});
addEventListener("leapt", ({ detail: k }) => { if (spent[k].times) spent[k].times += 1; });
addEventListener("skipped", ({ detail: k }) => { spent[k] = { times: 0, held: 0 }; });
addEventListener("restarted", () => { if (begun) spent.forEach((one) => { [one.times, one.held] = [0, 0]; }); });

function visit() { // the log, as biodance/dance/visit_log.py reads it
  const seen = window.followed, camera = Boolean(stream);
  return {
    biodance_dance_log: 1, dance: data.name, mark: data.mark, begun: (begun ?? new Date()).toISOString(), camera,
    speed: Number(by("speed").value),
    postures: cues.map((cue, k) => ({
      number: cue.number, times: spent[k].times, held_s: Number(spent[k].held.toFixed(1)), skipped: left_out.has(k),
      easier: half.has(k), told_percent: (camera ? seen?.told(k) : null) ?? null,
      reached_deg: (camera && seen?.reach(k)) || null,
    })),
    known_percent: (camera && seen?.known()) || null,
  };
}
by("save").onclick = () => {
  const link = document.createElement("a"), log = visit();
  link.href = URL.createObjectURL(new Blob([JSON.stringify(log, null, 1)], { type: "application/json" }));
  link.download = `dance_log_${log.begun.slice(0, 16).replace(/[:T]/g, "_")}.json`;
  link.click();
  URL.revokeObjectURL(link.href);
};

// ---- progress: a row a visit ----
let earlier = [];
by("earlier").onchange = async () => {
  const wrong = [];
  earlier = [];
  for (const file of by("earlier").files) {
    try {
      const log = JSON.parse(await file.text());
      if (log.biodance_dance_log !== 1 || !Array.isArray(log.postures)) throw new Error();
      earlier.push(log);
    } catch {
      wrong.push(file.name);
    }
  }
  by("unread").textContent = wrong.length
    ? say("No log of a dance: %(files)s. Take files that this page saved.", { files: wrong.join(", ") }) : "";
  compare();
};
function most(log, name) { // the farthest that a joint went in a visit, degrees
  const all = log.postures.map((one) => one.reached_deg?.[name]).filter(Number.isFinite);
  return all.length ? `${Math.max(...all)}°` : "–";
}
function compare() {
  const logs = [...earlier, ...(begun ? [visit()] : [])].sort((a, b) => (a.begun < b.begun ? -1 : 1));
  const names = [...new Set(logs.flatMap((log) => log.postures.flatMap((one) => Object.keys(one.reached_deg ?? {}))))];
  const danced = (log) => log.postures.filter((one) => one.times > 0);
  const rows = [[say("dance"), (log) => log.dance],
    [say("postures"), (log) => say("%(number)s of %(count)s", { number: danced(log).length, count: log.postures.length })],
    [say("easier"), (log) => danced(log).filter((one) => one.easier).length],
    [say("held still, s"), (log) => danced(log).reduce((sum, one) => sum + one.held_s, 0).toFixed(0)],
    ...names.map((name) => [say(name), (log) => most(log, name)])];
  const cell = (kind, text) => Object.assign(document.createElement(kind), { textContent: text });
  const row = (cells) => { const made = document.createElement("tr"); made.append(...cells); return made; };
  const heads = [cell("th", say("visit")), ...logs.map((log) => cell("th", log.begun.slice(0, 10)))];
  by("progress").replaceChildren(row(heads), ...rows.map(([name, value]) => row([cell("th", name),
    ...logs.map((log) => cell("td", value(log)))])));
  by("progress").hidden = !logs.length;
}
by("visits").ontoggle = compare;
