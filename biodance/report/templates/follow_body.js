// A body in the picture: the posture that puts its joints where the camera sees them, and what a movement tells of it.
const follow = data.follow, SIZE = follow.joints.length, PARTS = follow.segments.length, P = 10 * PARTS;
const PLAN = new Float32Array(bytes(follow.plan)), WIDE = 7 + SIZE, ROOT = new Float32Array(bytes(follow.root));

// ---- small matrices, 3 x 3 in rows ----
const at = (R, x) => [R[0] * x[0] + R[1] * x[1] + R[2] * x[2], R[3] * x[0] + R[4] * x[1] + R[5] * x[2],
  R[6] * x[0] + R[7] * x[1] + R[8] * x[2]];
const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const times = (s, a) => [s * a[0], s * a[1], s * a[2]];
const skew = (a) => [0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0];
const turned = (R) => [R[0], R[3], R[6], R[1], R[4], R[7], R[2], R[5], R[8]];
function product(A, B) {
  const out = new Array(9);
  for (let i = 0; i < 9; i += 3) for (let k = 0; k < 3; k++)
    out[i + k] = A[i] * B[k] + A[i + 1] * B[k + 3] + A[i + 2] * B[k + 6];
  return out;
}
function turn(w) { // about the vector w by its length, rad
  const angle = Math.hypot(...w);
  if (angle < 1e-9) return [1, -w[2], w[1], w[2], 1, -w[0], -w[1], w[0], 1];
  const [x, y, z] = times(1 / angle, w), c = Math.cos(angle), s = Math.sin(angle), v = 1 - c;
  return [c + x * x * v, x * y * v - z * s, x * z * v + y * s, y * x * v + z * s, c + y * y * v, y * z * v - x * s,
    z * x * v - y * s, z * y * v + x * s, c + z * z * v];
}
function spin(R) { // the vector of a small turn
  return times(0.5, [R[7] - R[5], R[2] - R[6], R[3] - R[1]]);
}
function unit([x, y, z, w]) { // of a quaternion
  const s = 2 / (x * x + y * y + z * z + w * w);
  return [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w),
    s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w),
    s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)];
}

// ---- where the segments are ----
function planned(second) { // root's place and turn, joint angles
  const on = Math.min(Math.max(second, 0) * follow.rate, PLAN.length / WIDE - 1), k = Math.floor(on), part = on - k;
  const mix = (j) => {
    const a = PLAN[k * WIDE + j], b = PLAN[Math.min(k + 1, PLAN.length / WIDE - 1) * WIDE + j];
    return a + part * (b - a);
  };
  return { place: [mix(0), mix(1), mix(2)], turn: unit([mix(3), mix(4), mix(5), mix(6)]),
    angles: Array.from({ length: SIZE }, (_, j) => mix(7 + j)) };
}
function pose({ place, turn: root, angles }) { // turn and place of every segment
  const turns = [], places = [];
  follow.joints.forEach((joint, i) => {
    const [R, x] = joint.parent < 0 ? [root, place] : [turns[joint.parent], places[joint.parent]];
    turns.push(product(R, product(joint.rotation, turn(times(angles[i], joint.axis)))));
    places.push(plus(x, at(R, joint.translation)));
  });
  return { turns: follow.carriers.map((j) => (j < 0 ? root : turns[j])),
    places: follow.carriers.map((j) => (j < 0 ? place : places[j])) };
}
const joints = (found) => follow.points.map(({ segment, place }) => plus(found.places[segment],
  at(found.turns[segment], place)));
function stand(state, like, planted) { // the same posture with its planted feet where they are planned
  const mean = (found) => times(1 / planted.length, planted.map((s) => found.places[s]).reduce(plus));
  if (!planted.length) return state;
  return { ...state, place: plus(state.place, minus(mean(pose(like)), mean(pose(state)))) };
}

// ---- the posture in the picture: most probable near the plan, by Gauss and Newton ----
let focus = 1.9; // of usual webcams, in halves of the picture's height; the aligned plate tells it
const SPREAD = 0.045; // of the points found, in halves of the picture's height
const FLAT = [0.1, 0.03]; // sd of what planted feet turn, rad, and of how far they are from where they are planned, m
const LOOSE = [1.2, 0.4, 0.4, 0.15, 0.1, 0.1, 0.1]; // sd: camera m, its tilt rad, turn of the pelvis rad
function seen(x, [cx, cy, cz, tilt]) { // in halves of the picture's height, unmirrored, y up
  const r = minus(x, [cx, cy, cz]), c = Math.cos(tilt), s = Math.sin(tilt), deep = Math.max(0.2, -c * r[0] - s * r[2]);
  return [(focus * r[1]) / deep, (focus * (c * r[2] - s * r[0])) / deep];
}
function moved(plan, p) {
  return { place: plan.place, turn: product(turn(p.slice(4, 7)), plan.turn),
    angles: plan.angles.map((angle, j) => angle + p[7 + j]) };
}
// points: {x, y, sure} or null, in the order of follow.points; planted: segments of the feet that stand, by which a leg
// that the camera sees from the front is known to bend when the pelvis comes down
function fit(points, plan, first, camera, planted) {
  const N = 7 + SIZE, centre = [...camera.at, 0, 0, 0, ...new Array(SIZE).fill(0)];
  const loose = [...(camera.count > 20 ? [0.15, 0.15, 0.15, 0.03, 0.1, 0.1, 0.1] : LOOSE),
    ...follow.joints.map((joint) => joint.free)];
  let p = first ? [...first] : [...centre];
  const like = pose(plan), rows = (q) => {
    const out = [], found = pose(stand(moved(plan, q), plan, planted));
    for (const s of planted) {
      out.push(...times(1 / FLAT[0], spin(product(found.turns[s], turned(like.turns[s])))));
      out.push(...times(1 / FLAT[1], minus(found.places[s], like.places[s])));
    }
    joints(found).forEach((x, k) => {
      if (!points[k]) return;
      const [u, v] = seen(x, q), weight = Math.sqrt(points[k].sure) / SPREAD;
      const a = weight * (u - points[k].x), b = weight * (v - points[k].y), far = Math.hypot(a, b);
      const tame = far > 2 ? Math.sqrt(2 / far) : 1; // Huber
      out.push(tame * a, tame * b);
    });
    return out;
  };
  for (let step = 0; step < 3; step++) {
    const r = rows(p), J = p.map((_, i) => {
      const q = [...p];
      q[i] += 1e-4;
      return rows(q).map((value, k) => (value - r[k]) / 1e-4);
    });
    const M = J.map((a, i) => J.map((b, k) => a.reduce((sum, value, m) => sum + value * b[m], 0)
      + (i === k ? 1 / loose[i] ** 2 : 0)));
    const v = J.map((a, i) => -a.reduce((sum, value, m) => sum + value * r[m], 0) - (p[i] - centre[i]) / loose[i] ** 2);
    const size = solve(M, v), most = Math.max(...size.map(Math.abs)), short = most > 0.6 ? 0.6 / most : 1;
    p = p.map((value, i) => value + short * size[i]);
  }
  const r = rows(p).slice(6 * planted.length);
  return { p, error: (SPREAD * Math.hypot(...r)) / Math.sqrt(Math.max(1, r.length / 2)), N };
}

// ---- what a movement tells: information on the 10 inertial parameters of every segment ----
function regress(states) { // 6 x P rows of the wrench about follow.about for all states but the first and the last
  const dt = 1 / follow.rate, found = states.map(pose);
  return found.slice(1, -1).map((now, t) => {
    const [before, after] = [found[t], found[t + 2]], W = new Float64Array(6 * P);
    for (let s = 0; s < PARTS; s++) {
      const R = now.turns[s], A = times(1 / dt ** 2, plus(minus(after.places[s], now.places[s]),
        minus(before.places[s], now.places[s])));
      const w1 = times(1 / dt, spin(product(R, turned(before.turns[s]))));
      const w2 = times(1 / dt, spin(product(after.turns[s], turned(R))));
      const w = times(0.5, plus(w1, w2)), dw = times(1 / dt, minus(w2, w1));
      segment(W, 10 * s, R, minus(now.places[s], follow.about), minus(A, follow.gravity), w, dw);
    }
    return W;
  });
}
function segment(W, first, R, x, A, w, dw) { // Newton and Euler in m, m c, Ixx, Ixy, Iyy, Ixz, Iyz, Izz
  const S = skew(w), local = turned(R), put = (row, column, value) => { W[row * P + first + column] += value; };
  const swing = product(skew(dw).map((value, i) => value + product(S, S)[i]), R), fall = product(skew(A), R);
  const inside = at(local, w), faster = at(local, dw), X = skew(x), T = skew(inside);
  const sums = ([a, b, c]) => [[a, b, 0, c, 0, 0], [0, a, b, 0, c, 0], [0, 0, 0, a, b, c]];
  const L = sums(faster), K = sums(inside);
  for (let i = 0; i < 3; i++) {
    put(i, 0, A[i]);
    put(3 + i, 0, X[3 * i] * A[0] + X[3 * i + 1] * A[1] + X[3 * i + 2] * A[2]);
    for (let k = 0; k < 3; k++) {
      put(i, 1 + k, swing[3 * i + k]);
      const lever = X[3 * i] * swing[k] + X[3 * i + 1] * swing[3 + k] + X[3 * i + 2] * swing[6 + k];
      put(3 + i, 1 + k, lever - fall[3 * i + k]);
    }
    for (let k = 0; k < 6; k++) {
      const own = [0, 1, 2].map((j) => L[j][k] + T[3 * j] * K[0][k] + T[3 * j + 1] * K[1][k] + T[3 * j + 2] * K[2][k]);
      put(3 + i, 4 + k, R[3 * i] * own[0] + R[3 * i + 1] * own[1] + R[3 * i + 2] * own[2]);
    }
  }
}
function information(states, held) { // P x P of a move, or of a posture that is held
  const W = regress(states), H = new Float64Array(P * P), count = W.length;
  const add = (row, weight) => {
    for (let i = 0; i < P; i++) {
      const one = weight * row[i];
      if (one) for (let k = 0; k <= i; k++) H[i * P + k] += one * row[k];
    }
  };
  if (held) {
    const row = W[count >> 1];
    follow.still.forEach((weight, n) => add(row.subarray((2 + n) * P, (3 + n) * P), weight));
  } else {
    for (let f = 0; f < count; f++) { // orthonormal cosine transform, band by band
      const hertz = (f * follow.rate) / (2 * count), band = follow.edges.findLastIndex((edge) => edge <= hertz);
      if (band >= follow.weights.length) continue;
      const X = new Float64Array(6 * P), scale = Math.sqrt((f ? 2 : 1) / count);
      for (let t = 0; t < count; t++) {
        const c = scale * Math.cos((Math.PI * f * (2 * t + 1)) / (2 * count));
        for (let i = 0; i < 6 * P; i++) X[i] += c * W[t][i];
      }
      for (let n = 0; n < 6; n++) add(X.subarray(n * P, (n + 1) * P), follow.weights[band][n]);
    }
  }
  for (let i = 0; i < P; i++) for (let k = 0; k < i; k++) H[k * P + i] = H[i * P + k];
  return H;
}
function shares(H) { // of every segment: the part of the table's variance that is gone, mean over its ten parameters
  const half = new Float64Array(P * P), M = new Float64Array(P * P);
  for (let i = 0; i < P; i++) for (let j = 0; j < P; j++) {
    const h = H[i * P + j];
    if (h) for (let k = 0; k < P; k++) half[i * P + k] += h * ROOT[j * P + k];
  }
  for (let j = 0; j < P; j++) for (let i = 0; i < P; i++) {
    const r = ROOT[j * P + i];
    if (r) for (let k = 0; k <= i; k++) M[i * P + k] += r * half[j * P + k];
  }
  for (let i = 0; i < P; i++) M[i * P + i] += 1;
  for (let k = 0; k < P; k++) { // Cholesky
    for (let j = 0; j < k; j++) { // left of the diagonal in row k
      let sum = M[k * P + j];
      for (let m = 0; m < j; m++) sum -= M[k * P + m] * M[j * P + m];
      M[k * P + j] = sum / M[j * P + j];
    }
    let sum = M[k * P + k];
    for (let m = 0; m < k; m++) sum -= M[k * P + m] ** 2;
    M[k * P + k] = Math.sqrt(sum);
  }
  const out = new Array(PARTS).fill(0), x = new Float64Array(P);
  for (let i = 0; i < P; i++) {
    let before = 0, after = 0;
    for (let k = 0; k < P; k++) {
      const r = ROOT[i * P + k];
      let sum = r;
      before += r * r;
      for (let m = 0; m < k; m++) sum -= M[k * P + m] * x[m];
      x[k] = sum / M[k * P + k];
      after += x[k] ** 2;
    }
    out[Math.floor(i / 10)] += before > 0 ? (1 - after / before) / 10 : 0;
  }
  return out;
}
