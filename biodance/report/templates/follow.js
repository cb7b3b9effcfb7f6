// Follows the person before the camera, grades every posture by what it tells, and asks for what is missing. Pictures
// go from the camera into a worker of this page and are forgotten there.
const LOOKS = 192, SURE = 0.3, ENOUGH = 0.9; // pixels; how sure a point; share of what the dance can tell
// misfit of the points, in halves of the picture's height: below it a fit is taken, above it none is believed
const GOOD = 0.035, POOR = 0.06;
const AGAIN = 12; // looks between two that look for somebody else
const NAMED = [["nose", 0], ...follow.points.map((one) => [one.name, one.number])];
let worker = null, busy = false, box = null, looks = 0, others = 0, unclear = { said: "", times: 0 };
let camera = { at: [2.8, 0, 1.0, 0], count: 0 }, last = null, knots = {}, paused = false;

// ---- the worker and its pictures ----
const page = (id) => bytes(by(id).textContent);
function begin() {
  if (worker) return;
  try {
    worker = new Worker(URL.createObjectURL(new Blob([page("pose-program")], { type: "text/javascript" })));
  } catch (error) {
    return report(say("This browser cannot follow you (%(why)s); the dance works without it.", { why: error.name }));
  }
  worker.onerror = () => report(say("Following failed in this browser; the dance works without it."));
  worker.onmessage = ({ data: told }) => {
    busy = false;
    if (told.error) return report(say("Following failed in this browser (%(why)s); the dance works without it.", { why: told.error }));
    document.body.dataset.follow = "ready";
    if (told.points) told.tag.second ? count(told) : take(told);
    look();
  };
  busy = true;
  report(say("Getting ready to follow you."));
  const [wasm, weights] = ["pose-kernels", "pose-weights"].map(page);
  worker.postMessage({ wasm, weights, topology: new TextDecoder().decode(page("pose-model")) }, [wasm, weights]);
}
const small = document.createElement("canvas");
small.width = small.height = LOOKS;
const pen = small.getContext("2d", { willReadFrequently: true });
function look() { // send the newest picture, cut to a square about the person; or all of it without the person
  const film = by("camera");
  if (!worker || busy || !stream || film.readyState < 2 || document.hidden) return;
  const width = film.videoWidth, height = film.videoHeight, size = Math.max(width, height);
  const whole = { x: (width - size) / 2, y: (height - size) / 2, size }, again = last && ++looks % AGAIN === 0;
  const cut = box && !again ? box : whole, s = LOOKS / cut.size;
  pen.fillStyle = "#777";
  pen.fillRect(0, 0, LOOKS, LOOKS);
  pen.drawImage(film, -cut.x * s, -cut.y * s, width * s, height * s);
  if (again && last.frame) pen.fillRect(...[last.frame.x - cut.x, last.frame.y - cut.y, last.frame.w, last.frame.h].map(
    (value) => value * s));
  const pixels = pen.getImageData(0, 0, LOOKS, LOOKS).data.buffer;
  busy = true;
  worker.postMessage({ pixels, tag: { cut, width, height, at: second, second: again } }, [pixels]);
}
function found({ points, tag }) { // 17 points in pixels of the picture
  const { x, y, size } = tag.cut;
  return Array.from({ length: 17 }, (_, k) => ({ x: x + points[3 * k + 1] * size, y: y + points[3 * k] * size,
    sure: points[3 * k + 2] }));
}
function extent(points, more) {
  const xs = points.map((one) => one.x), ys = points.map((one) => one.y), margin = more * Math.max(
    Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys));
  const left = Math.min(...xs) - margin, top = Math.min(...ys) - margin;
  return { x: left, y: top, w: Math.max(...xs) + margin - left, h: Math.max(...ys) + margin - top };
}
function around(points) { // the square about the hips that holds trunk and limbs (as in MoveNet's own demonstration)
  const trunk = [5, 6, 11, 12].map((k) => points[k]);
  if (trunk.some((one) => one.sure < 0.2)) return null;
  const x = (trunk[2].x + trunk[3].x) / 2, y = (trunk[2].y + trunk[3].y) / 2;
  const reach = (list) => Math.max(...list.map((one) => Math.max(Math.abs(one.x - x), Math.abs(one.y - y))));
  const half = Math.max(1.9 * reach(trunk), 1.2 * reach(points.filter((one) => one.sure > 0.2)));
  return { x: x - half, y: y - half, size: 2 * half };
}
function count(told) { // is there somebody else where the person is not?
  const sure = found(told).filter((one) => one.sure > SURE);
  others = sure.length >= 9 ? others + 1 : 0;
}

// ---- who is seen ----
function unseen(points) { // why nobody can be followed now; "" when somebody can
  const sees = (...names) => names.filter((name) => points[NAMED.find(([one]) => one === name)[1]].sure > SURE).length;
  const all = NAMED.filter(([name]) => sees(name)).length;
  if (all < 5) return say("I see nobody. Step into the picture.");
  if (others > 1) return say("I see two people. Only one may be in the picture.");
  if (sees("left shoulder", "right shoulder") < 2 && sees("nose") < 1) return say("I do not see your head and shoulders.");
  const legs = sees("left ankle", "right ankle", "left knee", "right knee");
  if (legs < 3) return say("I do not see your legs and feet. Step back.");
  return all < 9 ? say("I see only a part of you. Step back, into the light.") : "";
}
function take(told) {
  const points = found(told), why = unseen(points), { width, height, at: when } = told.tag;
  const sure = points.filter((one) => one.sure > SURE);
  document.body.dataset.looks = 1 + Number(document.body.dataset.looks ?? 0);
  document.body.dataset.ms = told.ms.toFixed(1);
  box = around(points);
  unclear = { said: why, times: why === unclear.said ? unclear.times + 1 : 1 };
  if (unclear.times === 3 || (why && unclear.times > 3 && by("followed").textContent !== why)) report(why);
  last = sure.length >= 5 ? { frame: extent(sure, 0.12), p: last?.p } : null;
  if (why || when < 0 || !playing) return;
  const now = moment(when), plan = planned(now.phase === "hold" ? reached(now.cue) : when);
  const spots = (order) => follow.points.map(({ number }) => {
    const { x, y, sure: s } = points[order(number)];
    return s > SURE ? { x: (2 * x - width) / height, y: 1 - (2 * y) / height, sure: s } : null;
  });
  const { planted } = follow.phases.findLast(({ start }) => when >= start) ?? follow.phases[0];
  const best = nearest(spots, plan, last.p, planted);
  if (!best.p.every(Number.isFinite) || best.error > POOR) return void (last.p = null);
  last.p = best.p;
  const share = 1 / Math.min(++camera.count, 50);
  camera.at = camera.at.map((value, k) => value + share * (best.p[k] - value));
  const own = planned(when); // what is kept is off the plan, also of who goes half of the way
  keep(when, { p: best.p.map((value, i) => (i < 7 ? value : value + plan.angles[i - 7] - own.angles[i - 7])) });
  correct(when, plan, best);
}
// of some descents: from the last look; else with sides confused, arms hanging
function nearest(spots, plan, before, planted) {
  const first = planned(0).angles, hang = [...camera.at, 0, 0, 0, ...first.map((angle, j) => angle - plan.angles[j])];
  let best = fit(spots((k) => k), plan, before, camera, planted);
  for (const [order, start] of [[(k) => k, hang], [(k) => (k % 2 ? k + 1 : k - 1), null],
    [(k) => (k % 2 ? k + 1 : k - 1), hang]]) {
    if (best.error < GOOD) break;
    const other = fit(spots(order), plan, start, camera, planted);
    if (!(other.error >= best.error)) best = other;
  }
  return best;
}
function report(text) {
  by("followed").textContent = text;
  document.body.dataset.followed = text;
}

// ---- what is told by what was danced: the plan, moved by what the camera saw at knots of time ----
const knot = (phase, when) => { // the end of a hold, the middle of a move
  const part = (when - phase.start) / (phase.end - phase.start);
  if (phase.kind === "hold") return part > 0.3 ? "hold" + phase.posture : null;
  return Math.abs(part - 0.5) < 0.17 ? "move" + phase.posture : null;
};
function keep(when, one) {
  const phase = follow.phases.find(({ start, end }) => when >= start && when < end), key = phase && knot(phase, when);
  if (key) (knots[key] ??= []).push(one.p.slice(4));
}
function middle(key) { // median over looks of every deviation; null when nothing was seen
  const rows = knots[key];
  return rows && rows[0].map((_, j) => rows.map((row) => row[j]).sort((a, b) => a - b)[rows.length >> 1]);
}
function states(phase, deviation) { // the motion of a phase as danced
  const steps = Math.max(3, Math.floor((phase.end - phase.start) * follow.rate + 1e-6) + 1);
  return Array.from({ length: steps }, (_, k) => {
    const part = k / (steps - 1), plan = planned(phase.start + part * (phase.end - phase.start)), d = deviation(part);
    if (!d) return plan;
    return stand(moved(plan, [0, 0, 0, 0, ...d]), plan, phase.planted);
  });
}
function danced(phase) { // information of a phase as the camera saw it; null when it did not
  const after = middle("hold" + phase.posture);
  if (phase.kind === "hold") return after && information(states(phase, () => after), true);
  const before = middle("hold" + (phase.posture - 1)), between = middle("move" + phase.posture);
  if (!after || !before) return null;
  const way = (part) => before.map((from, j) => { // on the plan's own way, and off it in the middle if that is plain
    const off = between ? between[j] - 0.5 * (from + after[j]) : 0; // rad
    const plain = Math.sign(off) * Math.max(0, Math.abs(off) - 0.2);
    return from + smooth(part) * (after[j] - from) + 16 * (part * (1 - part)) ** 2 * plain;
  });
  return information(states(phase, way), false);
}
const sum = (A, B) => A.map((value, i) => value + B[i]), mean = (list) => list.reduce((a, b) => a + b, 0) / list.length;
const full = [], intended = (phase) => full[follow.phases.indexOf(phase)] ??= information(states(phase, () => null),
  phase.kind === "hold");
let H = new Float64Array(P * P), known = new Array(PARTS).fill(0), goal = null, graded = new Set(), grades = {};
function grade(phase) { // after a hold: what the move that led to it and the posture itself have told
  const mine = follow.phases.filter((one) => one.posture === phase.posture), parts = mine.map(danced);
  graded.add(phase.posture);
  const whole = shares(mine.map(intended).reduce(sum, H)), before = known;
  parts.forEach((part) => { if (part) H = sum(H, part); });
  known = parts.some(Boolean) ? shares(H) : known;
  const got = mean(known) - mean(before), could = mean(whole) - mean(before);
  grades[phase.posture] = Math.round(100 * Math.min(1, Math.max(0, got / Math.max(could, 1e-6))));
  const number = cues[phase.posture].number;
  const short = shortest(phase.posture);
  by("grade").textContent = parts.some(Boolean)
    ? say("Posture %(number)s told of what it can:", { number }) + ` ${grades[phase.posture]} %.${short}`
    : say("Posture %(number)s: I did not see it.", { number });
  draw_known();
  if (!paused && known.every((value, s) => value >= ENOUGH * goal[s])) finish();
}
function shortest(k) { // what stayed farthest behind, by more than the camera errs
  const is = reach(k), want = asked_bends[k];
  const [name] = is ? Object.keys(is).sort((a, b) => want[b] - is[b] - want[a] + is[a]) : [];
  return name && want[name] - is[name] > 15
    ? " " + say("Seen: %(what)s %(is)s° of %(want)s°.", { what: say(name), is: is[name], want: Math.round(want[name]) }) : "";
}
function draw_known() {
  goal ??= shares(follow.phases.map(intended).reduce(sum));
  const percent = known.map((value, s) => Math.min(100, Math.round((100 * value) / goal[s])));
  by("parts").replaceChildren(...percent.map((value, s) => {
    const item = words(`${say(follow.segments[s])}: ${value} %`);
    item.style.setProperty("--share", value + "%");
    return item;
  }));
  document.body.dataset.known = known.map((value) => value.toFixed(4)).join(" ");
  document.body.dataset.goal = goal.map((value) => value.toFixed(4)).join(" ");
}
function finish() {
  paused = true;
  run(false);
  by("now").textContent = say("Enough is known. Thank you");
  by("ask").textContent = "";
  document.body.dataset.enough = second.toFixed(2);
}
function missing() { // at the end: the posture that adds most to what was danced
  const open = known.map((value, s) => value / goal[s]), least = open.indexOf(Math.min(...open));
  if (open[least] >= ENOUGH) return "";
  const gain = (p) => shares(follow.phases.filter((one) => one.posture === p).map(intended).reduce(sum, H))[least];
  const best = [...graded].map((p) => [gain(p), p]).sort((a, b) => b[0] - a[0])[0];
  if (!best) return "";
  return say("Least is known of this part: %(part)s. Dance posture %(number)s once more.",
    { part: say(follow.segments[least]), number: cues[best[1]].number });
}

// ---- how far the joints go, in degrees, by the points of the body ----
let bends = {}, asked_bends = {}; // of a posture: the angles of every look; those that are planned
const BENDS = { "arm lifted": ["shoulder", "elbow", "hip"], "elbow bent": ["elbow", "shoulder", "wrist"],
  "hip bent": ["hip", "shoulder", "knee"], "knee bent": ["knee", "hip", "ankle"] };
function angles_of(points) {
  const where = (name) => points[follow.points.findIndex((one) => one.name === name)], out = {};
  for (const side of ["left", "right"]) for (const [name, [at, one, other]] of Object.entries(BENDS)) {
    const [a, b] = [one, other].map((end) => minus(where(`${side} ${end}`), where(`${side} ${at}`)));
    const dot = a.reduce((sum, value, i) => sum + value * b[i], 0) / (Math.hypot(...a) * Math.hypot(...b));
    const angle = (180 / Math.PI) * Math.acos(Math.max(-1, Math.min(1, dot)));
    out[`${side} ${name}`] = name === "arm lifted" ? angle : 180 - angle;
  }
  return out;
}
const median = (list) => [...list].sort((a, b) => a - b)[list.length >> 1];
function reach(k) { // degrees of a posture as held; null when it was not seen
  const looks = bends[k];
  return looks ? Object.fromEntries(Object.keys(looks[0]).map((name) => [name, Math.round(median(looks.map((one) =>
    one[name])))])) : null;
}
window.followed = { reach, angles: (when) => angles_of(joints(pose(planned(when)))), told: (k) => grades[k] ?? null,
  known: () => goal && Object.fromEntries(known.map((value, s) => [follow.segments[s],
    Math.min(100, Math.round((100 * value) / goal[s]))])) };

// ---- what to correct now, in a posture that is held ----
const WAYS = [[2, "higher", "lower"], [1, "further to your left", "further to your right"]];
let asked_for = "", asked_times = 0;
function correct(when, plan, one) {
  const now = moment(when);
  if (now.phase !== "hold") return void (by("ask").textContent = "");
  const phase = follow.phases.find(({ kind, start, end }) => kind === "hold" && when >= start && when < end);
  if (!phase) return;
  const is = joints(pose(stand(moved(plan, one.p), plan, phase.planted))), want = joints(pose(plan));
  (bends[phase.posture] ??= []).push(angles_of(is));
  asked_bends[phase.posture] ??= angles_of(want);
  let worst = 0.1, said = ""; // m
  want.forEach((x, k) => WAYS.forEach(([axis, more, less]) => {
    const off = x[axis] - is[k][axis], weight = follow.points[k].asks;
    if (weight * Math.abs(off) > worst) [worst, said] = [weight * Math.abs(off),
      say("%(part)s %(way)s", { part: say(follow.points[k].name), way: say(off > 0 ? more : less) })];
  }));
  asked_times = said === asked_for ? asked_times + 1 : 0;
  asked_for = said;
  const text = said ? said[0].toUpperCase() + said.slice(1) + "." : say("Good.");
  if (asked_times >= 1) by("ask").replaceChildren(...words(text).childNodes);
}

// ---- in step with the page ----
addEventListener("camera", () => {
  by("known").hidden = !stream;
  if (stream) begin();
  else report("");
  last = box = null;
  camera.count = 0;
  if (stream) draw_known();
  look();
});
addEventListener("focal", ({ detail }) => { focus = detail; });
setInterval(look, 40);
addEventListener("shown", () => {
  if (!stream || !playing && second < data.duration_s) return;
  const over = follow.phases.find((one) => one.kind === "hold" && !graded.has(one.posture) && second >= one.end - 0.05
    && second < one.end + 3 && !left_out.has(one.posture));
  if (over) grade(over);
  if (second >= data.duration_s) by("ask").textContent = missing();
});
addEventListener("leapt", ({ detail: from }) => { // what is danced once more tells once more
  graded = new Set([...graded].filter((posture) => posture < from));
  for (const key of Object.keys(knots)) if (Number(key.slice(4)) >= from) delete knots[key];
  for (const key of Object.keys(bends)) if (Number(key) >= from) delete bends[key];
  paused = false;
});
addEventListener("restarted", () => {
  [H, known] = [new Float64Array(P * P), new Array(PARTS).fill(0)];
  [graded, grades, knots, bends, paused] = [new Set(), {}, {}, {}, false];
  for (const id of ["ask", "grade"]) by(id).textContent = "";
  if (stream) draw_known();
});
