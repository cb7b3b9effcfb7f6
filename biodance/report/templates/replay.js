"use strict";
// The replay: body, markers, plates and forces of one trial at one time, in step with the curves of that trial.
(() => {
  const data = JSON.parse(document.getElementById("replay-data").textContent);
  const root = document.querySelector(".replay"), part = (name) => root.querySelector(`[data-part=${name}]`);
  const COLOURS = { left: 0xd55e00, right: 0x0072b2, middle: 0x8a8f94 };
  const UNKNOWN = -32768;
  const numbers = (text) => new Int16Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  let trial = null, second = 0, playing = null, renderer = null;

  // ---- what is drawn ----------------------------------------------------------------------------------------------
  const scene = new THREE.Scene();
  scene.add(new THREE.HemisphereLight(0xffffff, 0x888888, 0.9));
  const lamp = new THREE.DirectionalLight(0xffffff, 0.5);
  lamp.position.set(3, -2, 4);
  scene.add(lamp);
  const add = (object) => (scene.add(object), object);

  function solid(box) { // a rounded solid that fills the box, as biodance.body.solids.box_solid
    const ball = new THREE.IcosahedronGeometry(1, 6), at = ball.getAttribute("position"), p = new THREE.Vector3();
    for (let i = 0; i < at.count; i++) {
      p.fromBufferAttribute(at, i);
      p.divideScalar((p.x ** 4 + p.y ** 4 + p.z ** 4) ** 0.25);
      const side = (k) => (box.low[k] + box.high[k]) / 2 + ((box.high[k] - box.low[k]) / 2) * p.getComponent(k);
      at.setXYZ(i, side(0), side(1), side(2));
    }
    ball.computeVertexNormals();
    const seen = { color: COLOURS[box.side], transparent: true, opacity: 0.55 };
    return new THREE.Mesh(ball, new THREE.MeshLambertMaterial(seen));
  }
  const bodies = data.boxes.map((box) => add(solid(box)));

  function ball(radius, colour) {
    const shape = new THREE.SphereGeometry(radius, 16, 12);
    return add(new THREE.Mesh(shape, new THREE.MeshLambertMaterial({ color: colour })));
  }
  const com = ball(0.025, 0x009e73), load = ball(0.055, 0xf0e442);

  function arrow(colour, radius) {
    const group = add(new THREE.Group()), paint = new THREE.MeshLambertMaterial({ color: colour });
    const shaft = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, 1, 12), paint);
    const head = new THREE.Mesh(new THREE.ConeGeometry(2.6 * radius, 6 * radius, 16), paint);
    group.add(shaft, head);
    return (start, along) => {
      const length = start && along ? along.length() : 0;
      group.visible = length > 6 * radius;
      if (!group.visible) return;
      group.position.copy(start);
      group.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.clone().normalize());
      shaft.scale.y = length - 6 * radius;
      shaft.position.y = (length - 6 * radius) / 2;
      head.position.y = length - 3 * radius;
    };
  }
  const measured = arrow(0x000000, 0.011), simulated = arrow(0x009e73, 0.009), left = arrow(0xcc79a7, 0.013);
  const floor = add(new THREE.GridHelper(6, 12, 0xcccccc, 0xe4e4e4));
  floor.rotation.x = Math.PI / 2;
  let markers = null, plates = null;

  function choose(name) {
    trial = data.trials.find((one) => one.name === name) || data.trials[0];
    for (const key of ["places", "turns", "forces"]) {
      if (typeof trial[key] === "string") trial[key] = numbers(trial[key]);
    }
    if (markers) scene.remove(markers, plates);
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * trial.markers), 3));
    markers = add(new THREE.Points(shape, new THREE.PointsMaterial({ color: 0x000000, size: 0.03 })));
    markers.frustumCulled = false;
    plates = add(new THREE.Group());
    for (const corners of trial.plates) {
      const loop = new THREE.BufferGeometry().setFromPoints(corners.map((c) => new THREE.Vector3(...c)));
      plates.add(new THREE.LineLoop(loop, new THREE.LineBasicMaterial({ color: 0x333333 })));
    }
    const end = trial.start_s + trial.step_s * (trial.frames - 1);
    [part("time").min, part("time").max, part("time").step] = [trial.start_s, end, "any"];
    part("trial").value = trial.name;
    part("worst").disabled = trial.worst_s === null;
    part("parameters").textContent = trial.parameters === "table" ? "the table's" : "the identified";
  }

  // ---- one moment -------------------------------------------------------------------------------------------------
  function place(frame, index, share) { // a point of the places between two frames, null where it is not known
    const count = trial.places.length / trial.frames / 3, next = Math.min(frame + 1, trial.frames - 1), out = [];
    for (let k = 0; k < 3; k++) {
      const [a, b] = [frame, next].map((f) => trial.places[3 * (f * count + index) + k]);
      if (a === UNKNOWN || b === UNKNOWN) return null;
      out.push(trial.origin[k] + trial.unit * (a + share * (b - a)));
    }
    return new THREE.Vector3(...out);
  }
  function turn(frame, index, share) {
    const next = Math.min(frame + 1, trial.frames - 1);
    const [a, b] = [frame, next].map((f) => {
      const at = 4 * (f * trial.segments + index);
      return new THREE.Quaternion(...trial.turns.slice(at, at + 4)).normalize();
    });
    return a.slerp(b, share);
  }
  function force(frame, which, scale) {
    const at = 3 * (3 * frame + which), row = trial.forces.slice(at, at + 3);
    return row.includes(UNKNOWN) ? null : new THREE.Vector3(...row).multiplyScalar(0.1 * scale);
  }

  const eye = { around: -0.7, up: 0.25, away: 4.2 };
  const camera = new THREE.PerspectiveCamera(30, 1, 0.1, 60);
  camera.up.set(0, 0, 1);

  function draw() {
    const at = Math.min(Math.max((second - trial.start_s) / trial.step_s, 0), trial.frames - 1);
    const frame = Math.floor(at), share = at - frame, last = trial.segments + trial.markers;
    const on = (name) => part(name).checked, state = Number(trial.state[frame]);
    bodies.forEach((mesh, i) => {
      const point = place(frame, data.boxes[i].on, share);
      mesh.visible = Boolean(point) && on("solids");
      if (!point) return;
      mesh.material.opacity = [0.55, 0.3, 0.12][state]; // measured, filled, not determined: a guess
      mesh.position.copy(point);
      mesh.quaternion.copy(turn(frame, data.boxes[i].on, share));
    });
    const points = markers.geometry.getAttribute("position");
    for (let k = 0; k < trial.markers; k++) {
      const point = place(frame, trial.segments + k, share);
      points.setXYZ(k, ...(point ? point.toArray() : [0, 0, -99]));
    }
    points.needsUpdate = true;
    markers.visible = on("markers");
    const middle = place(frame, last, share), shown = on("forces");
    com.position.copy(middle);
    measured(shown && place(frame, last + 1, share), force(frame, 0, data.force_scale));
    simulated(shown && place(frame, last + 2, share), force(frame, 1, data.force_scale));
    left(shown && middle, force(frame, 2, data.residual_scale));
    load.visible = data.load !== null;
    if (data.load) {
      const about = turn(frame, data.load.on, share);
      load.position.copy(new THREE.Vector3(...data.load.place).applyQuaternion(about));
      load.position.add(place(frame, data.load.on, share));
    }
    const size = force(frame, 2, 1), word = part("said");
    word.textContent = `${second.toFixed(2)} s` + (size ? ` \u00b7 residual ${size.length().toFixed(0)} N` : "")
      + ["", " \u00b7 markers filled", " \u00b7 not determined by the markers"][state];
    part("time").value = second;
    part("time").setAttribute("aria-valuetext", word.textContent);
    if (!renderer) return;
    const canvas = part("scene"), [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width) return;
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    const flat = Math.cos(eye.up) * eye.away, target = new THREE.Vector3(middle.x, middle.y, 0.9);
    const from = [flat * Math.cos(eye.around), flat * Math.sin(eye.around), Math.sin(eye.up) * eye.away];
    camera.position.copy(target).add(new THREE.Vector3(...from));
    camera.lookAt(target);
    renderer.render(scene, camera);
  }

  function go(to, told) {
    const end = trial.start_s + trial.step_s * (trial.frames - 1);
    second = Math.min(Math.max(to, trial.start_s), end);
    draw();
    const detail = { trial: trial.name, time: second, from: root };
    if (told) document.dispatchEvent(new CustomEvent("biodance:time", { detail }));
  }

  // ---- controls ---------------------------------------------------------------------------------------------------
  for (const one of data.trials) part("trial").append(new Option(one.name, one.name));
  part("trial").addEventListener("change", () => { choose(part("trial").value); go(trial.worst_s ?? trial.start_s, true); });
  part("time").addEventListener("input", () => go(Number(part("time").value), true));
  part("worst").addEventListener("click", () => go(trial.worst_s, true));
  for (const name of ["solids", "markers", "forces"]) part(name).addEventListener("change", draw);
  for (const [name, around, up] of [["front", 0, 0.1], ["side", -Math.PI / 2, 0.1], ["top", -Math.PI / 2, 1.5]]) {
    part(name).addEventListener("click", () => { [eye.around, eye.up] = [around, up]; draw(); });
  }

  function play(on) {
    cancelAnimationFrame(playing);
    playing = null;
    part("play").textContent = on ? "Pause" : "Play";
    if (!on) return;
    let before = null;
    const step = (now) => {
      const end = trial.start_s + trial.step_s * (trial.frames - 1);
      const speed = Number(part("speed").value);
      const next = second + (before === null ? 0 : ((now - before) / 1000) * speed);
      before = now;
      go(next > end ? trial.start_s : next, true);
      playing = requestAnimationFrame(step);
    };
    playing = requestAnimationFrame(step);
  }
  part("play").addEventListener("click", () => play(playing === null));
  document.addEventListener("biodance:time", ({ detail }) => {
    if (detail.from === root || playing !== null) return;
    if (detail.trial !== trial.name && data.trials.some((one) => one.name === detail.trial)) choose(detail.trial);
    if (detail.trial === trial.name) go(detail.time, false);
  });

  const canvas = part("scene");
  canvas.addEventListener("pointermove", (event) => {
    if (!(event.buttons & 1)) return;
    eye.around -= 0.008 * event.movementX;
    eye.up = Math.min(1.55, Math.max(-0.3, eye.up + 0.008 * event.movementY));
    draw();
  });
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.shiftKey) return; // the page scrolls; with Ctrl or Shift the picture comes nearer
    event.preventDefault();
    eye.away = Math.min(12, Math.max(1.2, eye.away * Math.exp(0.001 * (event.deltaY || event.deltaX))));
    draw();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const move = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === "+" || event.key === "-") eye.away *= event.key === "+" ? 0.9 : 1.1;
    else if (event.key === " ") play(playing === null);
    else if (move) return event.preventDefault(), go(second + move * trial.step_s, true);
    else return;
    event.preventDefault();
    draw();
  });

  const worst = data.trials.filter((one) => one.worst_s !== null);
  choose((worst.find((one) => one.name === root.dataset.trial) || worst[0] || data.trials[0]).name);
  second = trial.worst_s ?? trial.start_s;
  new IntersectionObserver(([seen], observer) => {
    if (!seen.isIntersecting) return;
    observer.disconnect();
    try {
      renderer = new THREE.WebGLRenderer({ canvas, alpha: true, antialias: true, preserveDrawingBuffer: true });
    } catch (error) {
      const drawn = ["scene", "front", "side", "top", "legend"].map(part);
      drawn.push(...["solids", "markers", "forces"].map((name) => part(name).closest("label")));
      for (const one of drawn) one.hidden = true;
      part("undrawn").hidden = false;
      return;
    }
    draw();
    addEventListener("resize", draw);
  }).observe(canvas);
  draw();
})();
