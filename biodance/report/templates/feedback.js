"use strict";
// The page that leads: what is shown is a function of one number, the second of the dance (negative: before it).
const data = JSON.parse(document.getElementById("data").textContent);
const by = (id) => document.getElementById(id);
const say = (text, values = {}) => Object.entries(values).reduce((said, [name, value]) =>
  said.replaceAll(`%(${name})s`, value), data.words?.[text] ?? text);
const SIDES = ["left", "right"].map((side) => [side, (side === "left" ? say("left") : say("right")).split("|")]);
const SIDE = new RegExp(`(\\b(?:${SIDES.flatMap(([, names]) => names).join("|")})\\b(?! angle))`);
const LEAD = 5, SHARE = 0.5; // s to get ready; speed of the preview
const COLOURS = { left: 0xd55e00, right: 0x0072b2, "": 0x8a8f94 };
const still = matchMedia("(prefers-reduced-motion: reduce)").matches;

function bytes(text) {
  return Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
}

// ---- the body ----------------------------------------------------------------------------------------------------
const POSES = new Int16Array(bytes(data.poses)), COUNT = data.segments.length;
const scene = new THREE.Scene();
scene.add(new THREE.HemisphereLight(0xffffff, 0x777777, 0.9));
const lamp = new THREE.DirectionalLight(0xffffff, 0.5);
lamp.position.set(3, -2, 4);
scene.add(lamp);

function figure(opacity) {
  const group = new THREE.Group();
  for (const one of data.segments) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(bytes(one.vertices)), 3));
    geometry.setIndex(new THREE.BufferAttribute(new Uint16Array(bytes(one.faces)), 1));
    const flat = geometry.toNonIndexed();
    flat.computeVertexNormals();
    const seen = { color: COLOURS[one.side], side: THREE.DoubleSide, transparent: opacity < 1, opacity,
      depthWrite: opacity === 1 };
    group.add(new THREE.Mesh(flat, new THREE.MeshLambertMaterial(seen)));
  }
  scene.add(group);
  return group;
}

const A = new THREE.Quaternion(), B = new THREE.Quaternion();
function place(group, second) { // as planned at that second
  const at = Math.min(Math.max(second, 0) * data.rate_hz, data.frames - 1);
  const k = Math.min(Math.floor(at), data.frames - 2), part = at - k;
  group.children.forEach((mesh, i) => {
    const a = 7 * (k * COUNT + i), b = a + 7 * COUNT, mix = (j) => POSES[a + j] + part * (POSES[b + j] - POSES[a + j]);
    mesh.position.set(mix(0) / 1e4, mix(1) / 1e4, mix(2) / 1e4);
    A.set(POSES[a + 3], POSES[a + 4], POSES[a + 5], POSES[a + 6]).normalize();
    B.set(POSES[b + 3], POSES[b + 4], POSES[b + 5], POSES[b + 6]).normalize();
    mesh.quaternion.copy(A.slerp(B, part));
  });
}
function between(group, from, to, share) { // turns between two planned postures; limbs stay joined
  place(group, from);
  const before = group.children.map((mesh) => [mesh.position.clone(), mesh.quaternion.clone()]);
  place(group, to);
  const after = group.children.map((mesh) => [mesh.position.clone(), mesh.quaternion.clone()]);
  group.children.forEach((mesh, i) => {
    const parent = data.segments[i].parent;
    mesh.quaternion.copy(before[i][1]).slerp(after[i][1], share);
    if (parent < 0) return void mesh.position.lerpVectors(before[i][0], after[i][0], share);
    const joint = after[i][0].clone().sub(after[parent][0]).applyQuaternion(after[parent][1].clone().invert());
    mesh.position.copy(joint.applyQuaternion(group.children[parent].quaternion).add(group.children[parent].position));
  });
}

const body = figure(1), ghost = figure(0.3);
const lines = new THREE.Group();
scene.add(lines);
const PLATE = data.plate; // m, what is aligned with the plate's corners
function outline(points, colour) {
  const loop = points.map(([x, y]) => new THREE.Vector3(x, y, 0.002));
  const geometry = new THREE.BufferGeometry().setFromPoints(loop);
  return new THREE.LineLoop(geometry, new THREE.LineBasicMaterial({ color: colour }));
}

// ---- cameras ------------------------------------------------------------------------------------------------------
const canvas = by("scene");
let renderer = null;
try {
  renderer = new THREE.WebGLRenderer({ canvas, alpha: true, antialias: true, preserveDrawingBuffer: true });
} catch (error) {
  for (const one of [canvas, by("label-left"), by("label-right"), by("view").closest("label")]) one.hidden = true;
  by("undrawn").hidden = false;
}
const front = new THREE.PerspectiveCamera(32, 1, 0.1, 50), side = new THREE.PerspectiveCamera(32, 1, 0.1, 50);
for (const [camera, x, y] of [[front, 4.3, 0], [side, 0, -4.3]]) {
  camera.up.set(0, 0, 1);
  camera.position.set(x, y, 1.15);
  camera.lookAt(0, 0, 0.95);
}
let aligned = null; // projection and view by the plate's corners in the picture

function look(camera, x, width, height, mirror) {
  camera.aspect = width / height;
  camera.fov = width < 0.6 * height ? 50 : 32;
  camera.updateProjectionMatrix();
  if (mirror && aligned) {
    camera.projectionMatrix.copy(aligned.projection);
    camera.matrixAutoUpdate = false;
    camera.matrix.copy(aligned.place);
    camera.matrixWorld.copy(aligned.place);
    camera.matrixWorldInverse.copy(aligned.place).invert();
  }
  if (mirror) camera.projectionMatrix.premultiply(new THREE.Matrix4().makeScale(-1, 1, 1));
  camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
  renderer.setViewport(x, 0, width, height);
  renderer.setScissor(x, 0, width, height);
  renderer.render(scene, camera);
}

const HANDS = ["left", "right"].map((s) => data.segments.findIndex((one) => one.name === s + "_forearm_hand"));
function label(camera, x, width, height) {
  ["left", "right"].forEach((name, n) => {
    const mark = by("label-" + name);
    mark.hidden = HANDS[n] < 0;
    if (mark.hidden) return;
    const mesh = body.children[HANDS[n]];
    const at = new THREE.Vector3(0, -0.3, 0).applyQuaternion(mesh.quaternion).add(mesh.position).project(camera);
    mark.style.transform = `translate(${x + (0.5 + 0.5 * at.x) * width}px, ${(0.5 - 0.5 * at.y) * height}px)`;
  });
}

function draw() {
  if (!renderer) return;
  const width = canvas.clientWidth, height = canvas.clientHeight, view = by("view").value;
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  renderer.setSize(width, height, false);
  renderer.setScissorTest(true);
  if (view === "both") {
    look(front, 0, width / 2, height, true);
    look(side, width / 2, width / 2, height, false);
    label(front, 0, width / 2, height);
  } else {
    look(view === "front" ? front : side, 0, width, height, view === "front");
    label(view === "front" ? front : side, 0, width, height);
  }
}

// ---- the person's own way: postures that are left out, or half as far, and where the figure is then ----
const left_out = new Set(), half = new Set(); // of cues
const smooth = (u) => u * u * u * (10 - 15 * u + 6 * u * u);
function reached(k) { // planned second of the posture in which a cue ends
  if (k < 0) return 0;
  const { move_s, hold_s } = cues[k];
  return left_out.has(k) ? reached(k - 1) : half.has(k) ? (move_s + hold_s) / 2 : hold_s;
}
function stand_in(now, at) { // planned seconds between which the figure is, and how near it is to the second one
  const { move_s, hold_s } = cues[now.cue], goal = reached(now.cue), from = reached(now.cue - 1);
  if (now.phase === "ready" || (now.phase === "end" && goal === hold_s)) return [at, at, 1];
  if (now.phase !== "move") return [goal, goal, 1];
  const part = smooth((at - move_s) / (hold_s - move_s));
  const way = goal === hold_s ? at : move_s + part * (goal - move_s);
  return !now.cue || from === cues[now.cue - 1].hold_s ? [way, way, 1] : [from, way, part];
}
function coming(now) { // the cue that is asked next, or now
  return now.phase === "hold" ? Math.min(now.cue + 1, cues.length - 1) : now.cue;
}
function calls_of(k) { // what is called when some before it were left out; null where the feet change meanwhile
  let skipped = 0;
  while (skipped < k && left_out.has(k - 1 - skipped)) skipped++;
  return skipped ? cues[k].after_skips[skipped - 1] ?? null : cues[k].calls;
}
function may_skip(k) {
  if (k + 1 >= cues.length) return false;
  const was = left_out.has(k);
  left_out.add(k);
  const can = calls_of(k + 1) !== null;
  if (!was) left_out.delete(k);
  return can;
}

// ---- what is told -------------------------------------------------------------------------------------------------
const cues = data.cues;
function moment(second) {
  if (second >= data.duration_s) return { phase: "end", cue: cues.length - 1, left: 0 };
  let k = cues.findLastIndex((cue) => cue.move_s <= second);
  if (second < 0 || k < 0) return { phase: "ready", cue: 0, left: -second };
  const cue = cues[k];
  if (second < cue.hold_s) return { phase: "move", cue: k, left: cue.hold_s - second };
  const next = k + 1 < cues.length ? cues[k + 1].move_s : data.duration_s;
  return { phase: "hold", cue: k, left: next - second };
}

function words(text) {
  const item = document.createElement("li");
  for (const part of text.split(SIDE)) {
    const span = document.createElement("span");
    span.className = SIDES.find(([, names]) => names.includes(part))?.[0] ?? "";
    span.textContent = part;
    item.append(span);
  }
  return item;
}

let told = "";
function tell(now) {
  const next = coming(now), last = now.phase === "hold" && now.cue === cues.length - 1;
  by("count").textContent = now.phase === "end" ? "" : Math.max(1, Math.ceil(now.left + wait - 1e-6));
  const key = [now.phase, now.cue, pausing, half.has(next), ...left_out].join(" ");
  if (key === told) return;
  told = key;
  const shown = cues[next], called = calls_of(next) ?? shown.calls;
  const asked = now.phase === "end" || last ? [] : half.has(next) ? [say("only half of the way:"), ...called] : called;
  by("number").textContent = now.phase === "end" ? say("The end")
    : say("%(number)s of %(count)s", { number: cues[now.cue].number, count: cues.length });
  by("stance").textContent = (now.phase === "hold" && !last ? say("next:") + " " : "") + shown.stance;
  by("told").className = now.phase;
  let held_in = now.cue;
  while (held_in && left_out.has(held_in)) held_in--;
  const back = say("Take up posture %(number)s again. Next:", { number: cues[held_in].number });
  const hold = last ? data.still : say("%(still)s. Next:", { still: data.still });
  by("now").textContent = pausing === "rest" ? say("Rest. Let free arms down") : pausing === "back" ? back :
    { ready: say("Get ready"), move: say("Move now"), end: say("Thank you"), hold }[now.phase];
  by("calls").replaceChildren(...asked.map(words));
  by("care").hidden = now.phase !== "ready" && pausing !== "rest";
  by("easier").disabled = !shown.can_half || last || now.phase === "end";
  by("easier").setAttribute("aria-pressed", String(half.has(next)));
  by("skip").disabled = last || now.phase === "end" || !may_skip(next);
  speak(now.phase === "move" ? say("Now.") : [by("now").textContent, ...asked].join(" "));
  lines.clear();
  lines.add(outline(PLATE, 0xb0b6bb), ...shown.feet.map((points) => outline(points, 0x222222)));
}

const slow = (cue) => (cue.hold_s - cue.move_s) / SHARE; // s of its move in slow motion
function preview(second, now) { // what comes, in slow motion while the person holds still
  ghost.visible = now.phase === "hold" ? now.cue + 1 < cues.length : now.phase !== "end";
  const k = coming(now), { move_s, hold_s } = cues[k];
  if (now.phase !== "hold" || still) return place(ghost, reached(k));
  const since = (second - cues[now.cue].hold_s + waited) % (slow(cues[k]) + 1);
  const at = Math.min(move_s + SHARE * since, hold_s);
  between(ghost, ...stand_in({ phase: at < hold_s ? "move" : "hold", cue: k }, at));
}

// ---- the voice: one of this computer, if asked for ----
const voices = window.speechSynthesis;
by("speak").closest("label").hidden = !voices;
voices?.getVoices(); // asked early: a browser fills its list later
function speak(text) {
  if (!voices || !by("speak").checked || !playing) return;
  const tongue = document.documentElement.lang.slice(0, 2);
  const voice = voices.getVoices().find((one) => one.localService && one.lang.startsWith(tongue));
  if (!voice) return void (by("said").textContent =
    say("This browser has no voice of its own for this language: nothing is spoken."));
  const said = new SpeechSynthesisUtterance(text.replaceAll("°", " " + say("degrees")));
  said.voice = voice;
  voices.cancel();
  voices.speak(said);
}

// ---- sound --------------------------------------------------------------------------------------------------------
let audio = null;
function beep(tone, length) {
  if (!by("sound").checked || !audio) return;
  const source = audio.createOscillator(), gain = audio.createGain();
  source.frequency.value = tone;
  gain.gain.setValueAtTime(0.2, audio.currentTime);
  gain.gain.exponentialRampToValueAtTime(0.001, audio.currentTime + length);
  source.connect(gain).connect(audio.destination);
  source.start();
  source.stop(audio.currentTime + length);
}
function sound(before, now) {
  if (before.phase !== "move" && now.phase === "move") beep(880, 0.5);
  else if (before.phase === "move" && now.phase === "hold") beep(440, 0.3);
  else if (now.phase !== "move" && now.left <= 3 && Math.ceil(before.left) !== Math.ceil(now.left)) beep(587, 0.12);
}

// ---- time ---------------------------------------------------------------------------------------------------------
const asked = Number(new URLSearchParams(location.hash.slice(1)).get("t") ?? NaN);
let second = Number.isFinite(asked) ? asked : -LEAD, playing = false, stamp = 0, frames = 0;
let wait = 0, waited = 0, pausing = ""; // s that the dance stands still, and has in this hold; "rest", "back" or ""
const rested = new Set(); // cues
function show() {
  const now = moment(second);
  between(body, ...stand_in(now, second));
  preview(second, now);
  tell(now);
  draw();
  document.body.dataset.second = second.toFixed(3);
  document.body.dataset.phase = now.phase;
  document.body.dataset.frames = ++frames;
  dispatchEvent(new Event("shown"));
}
function tick(time) {
  if (!playing) return;
  const before = moment(second), spent = Math.min(Math.max(time - stamp, 0), 1000) / 1000;
  stamp = time;
  dispatchEvent(new CustomEvent("danced", { detail: { ...before, spent } }));
  const waits = Math.min(wait, spent), end = waits < wait ? second : second + (spent - waits) *
    Number(by("speed").value);
  [wait, waited] = [wait - waits, waited + waits];
  const now = moment(end);
  if (end > second) pausing = "";
  if (before.phase === "hold" && now.phase === "move" && cues[before.cue].rest && !rested.has(before.cue)) {
    rested.add(before.cue);
    pausing = "rest";
    return run(false);
  }
  second = end;
  sound(before, now);
  if (now.phase !== before.phase || now.cue !== before.cue) arrive(now);
  show();
  if (second >= data.duration_s) run(false);
  else requestAnimationFrame(tick);
}
function arrive(now) { // in another part of the dance: look first at what comes, if asked for
  waited = 0;
  if (now.phase !== "hold" || now.cue + 1 >= cues.length || !by("first").checked) return;
  wait = Math.max(wait, slow(cues[now.cue + 1]) + 0.5 - now.left);
}
function run(on) {
  playing = on;
  by("play").textContent = on ? say("Pause") : second > -LEAD && second < data.duration_s ? say("Go on") : say("Start");
  if (!on) return show();
  if (second >= data.duration_s) restart();
  if (pausing === "rest") [pausing, wait] = ["back", LEAD];
  told = ""; // said once more, aloud if asked for
  audio = audio || new AudioContext();
  stamp = performance.now();
  requestAnimationFrame(tick);
}
function repeat() { // the posture of the moment: back to the one before it, and once more
  const k = moment(second).cue;
  dispatchEvent(new CustomEvent("leapt", { detail: k }));
  left_out.delete(k);
  rested.delete(k);
  [second, waited, wait] = k ? [cues[k - 1].hold_s, 0, cues[k].hold_s - cues[k].move_s] : [-LEAD, 0, 0];
  pausing = k ? "back" : "";
  show();
}
function skip() { // what comes: the person stays in the posture before it
  const k = coming(moment(second));
  if (!may_skip(k) || second >= data.duration_s) return;
  left_out.add(k);
  half.delete(k);
  [second, waited, wait, pausing] = [cues[k].hold_s, 0, 0, ""];
  dispatchEvent(new CustomEvent("skipped", { detail: k }));
  arrive(moment(second));
  show();
}
function easier() { // what comes: half of the way, which is a part of the planned one
  const k = coming(moment(second));
  if (by("easier").disabled) return;
  half.has(k) ? half.delete(k) : half.add(k);
  show();
}
function restart() {
  [second, wait, waited, pausing] = [-LEAD, 0, 0, ""];
  for (const some of [left_out, half, rested]) some.clear();
  dispatchEvent(new Event("restarted"));
}
function stop() {
  restart();
  run(false);
}
by("play").onclick = () => run(!playing);
by("stop").onclick = stop;
by("repeat").onclick = repeat;
by("easier").onclick = easier;
by("skip").onclick = skip;
by("view").onchange = show;
addEventListener("resize", show);
addEventListener("keydown", (event) => {
  if (event.target.matches("select, input, button") && event.key === " ") return;
  const does = { " ": () => run(!playing), Escape: stop, ArrowLeft: repeat, ArrowRight: skip, e: easier,
    v: () => { by("view").selectedIndex = (by("view").selectedIndex + 1) % 3; show(); } }[event.key];
  if (!does || (event.target.matches("select") && event.key.startsWith("Arrow"))) return;
  event.preventDefault();
  does();
});

// ---- the mirror: a camera behind the figure, aligned with the corners of the plate ----
let stream = null;
by("film").onclick = async () => {
  if (stream) {
    stream.getTracks().forEach((track) => track.stop());
    stream = null;
  } else {
    try {
      stream = await navigator.mediaDevices.getUserMedia({ video: { facingMode: "user" }, audio: false });
      by("camera").srcObject = stream;
      await by("camera").play();
      by("said").textContent = "";
    } catch (error) {
      stream = null;
      by("said").textContent = error.name === "NotAllowedError"
        ? say("The camera was not allowed; the dance works without it.")
        : say("There is no camera to be used (%(why)s); the dance works without it.", { why: error.name });
    }
  }
  by("camera").hidden = by("align").hidden = !stream;
  by("film").setAttribute("aria-pressed", String(Boolean(stream)));
  if (!stream) { aligned = null; corners(false); }
  dispatchEvent(new Event("camera"));
  show();
};

let held = [[0.35, 0.85], [0.65, 0.85], [0.6, 0.72], [0.4, 0.72]]; // of width and height, in the mirrored picture
function corners(on) {
  by("align").setAttribute("aria-pressed", String(on));
  held.forEach(([x, y], k) => {
    const mark = by("corner-" + k);
    mark.hidden = !on;
    mark.style.left = 100 * x + "%";
    mark.style.top = 100 * y + "%";
  });
}
by("align").onclick = () => {
  const on = by("align").getAttribute("aria-pressed") !== "true";
  corners(on);
  if (on) { align(); show(); }
};
held.forEach((_, k) => {
  by("corner-" + k).onpointermove = (event) => {
    if (!event.buttons) return;
    event.target.setPointerCapture(event.pointerId);
    const box = by("stage").getBoundingClientRect();
    held[k] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    corners(true);
    align();
    show();
  };
});

function solve(M, v) { // Gauss with pivoting; M is spoilt
  const n = v.length;
  for (let i = 0; i < n; i++) {
    let p = i;
    for (let r = i + 1; r < n; r++) if (Math.abs(M[r][i]) > Math.abs(M[p][i])) p = r;
    [M[i], M[p]] = [M[p], M[i]];
    [v[i], v[p]] = [v[p], v[i]];
    for (let r = i + 1; r < n; r++) {
      const f = M[r][i] / M[i][i];
      for (let c = i; c < n; c++) M[r][c] -= f * M[i][c];
      v[r] -= f * v[i];
    }
  }
  for (let i = n - 1; i >= 0; i--) {
    for (let c = i + 1; c < n; c++) v[i] -= M[i][c] * v[c];
    v[i] /= M[i][i];
  }
  return v;
}

// Focal length in halves of the height by the images of the plate's axes, which are at right angles and equally long:
// the least squares of both conditions; as of usual webcams where the picture does not tell.
function focal(a, b) {
  const rows = [[a[0] * b[0] + a[1] * b[1], a[2] * b[2]],
    [(a[0] ** 2 + a[1] ** 2 - b[0] ** 2 - b[1] ** 2) / 2, (a[2] ** 2 - b[2] ** 2) / 2]];
  const inverse = -rows.reduce((sum, [p, q]) => sum + p * q, 0) / rows.reduce((sum, [p]) => sum + p * p, 0);
  return inverse > 1 / 25 && inverse < 2 ? 1 / Math.sqrt(inverse) : 1.9;
}

function align() { // the camera whose picture has the plate's corners where they were drawn (Zhang 2000, one plane)
  const height = canvas.clientHeight, width = canvas.clientWidth, M = [], v = [];
  PLATE.forEach(([X, Y], k) => { // unmirrored, centred, y up, in halves of the height
    const x = -(2 * held[k][0] - 1) * (width / height), y = 1 - 2 * held[k][1];
    M.push([X, Y, 1, 0, 0, 0, -x * X, -x * Y], [0, 0, 0, X, Y, 1, -y * X, -y * Y]);
    v.push(x, y);
  });
  const h = solve(M, v), [a, b, t] = [[h[0], h[3], h[6]], [h[1], h[4], h[7]], [h[2], h[5], 1]];
  const f = focal(a, b);
  dispatchEvent(new CustomEvent("focal", { detail: f }));
  const ray = (c) => new THREE.Vector3(c[0] / f, c[1] / f, -c[2]);
  const X = ray(a), Y = ray(b), scale = 2 / (X.length() + Y.length());
  X.normalize();
  const Z = new THREE.Vector3().crossVectors(X, Y.normalize()).normalize();
  const view = new THREE.Matrix4().makeBasis(X, new THREE.Vector3().crossVectors(Z, X), Z);
  view.setPosition(ray(t).multiplyScalar(scale));
  const by2 = height / width, near = 0.1, far = 50;
  aligned = { place: view.invert(), projection: new THREE.Matrix4().set(f * by2, 0, 0, 0, 0, f, 0, 0, 0, 0,
    (far + near) / (near - far), (2 * far * near) / (near - far), 0, 0, -1, 0) };
}
