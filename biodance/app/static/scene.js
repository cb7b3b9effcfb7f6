// Markers of one trial in three dimensions: filled places are drawn hollow, gaps are not drawn; a click names a marker.
import { h } from "./dom.js";

const UNKNOWN = -32768;
const COLOURS = { seen: "#1b1b1b", filled: "#b45309", chosen: "#d1008f" };

async function library() {
  // three.js, as the pages of results have it, loaded once
  if (!window.THREE) {
    await new Promise((done, failed) =>
      document.head.append(h("script", { src: "/static/three.js", onload: done, onerror: failed })),
    );
  }
  return window.THREE;
}

const numbers = (text) => new Int16Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);

export async function markerScene(data, { chosen, onchoose }) {
  const THREE = await library(),
    places = numbers(data.places),
    many = data.names.length;
  const canvas = h("canvas", {
    tabindex: "0",
    role: "img",
    "aria-label":
      "Markers in three dimensions. Drag to turn, plus and minus to come nearer, arrows for the next frame.",
  });
  let renderer = null;
  try {
    renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
  } catch {
    return {
      element: h("p", { cls: "warn" }, "This browser does not draw in 3-D (WebGL is switched off or missing)."),
      choose() {},
    };
  }
  const scene = new THREE.Scene(),
    camera = new THREE.PerspectiveCamera(30, 1, 0.05, 100);
  camera.up.set(0, 0, 1);
  const floor = new THREE.GridHelper(6, 12, 0xbbbbbb, 0xdddddd);
  floor.rotation.x = Math.PI / 2;
  scene.add(floor);
  for (const corners of data.plates) {
    const shape = new THREE.BufferGeometry().setFromPoints(corners.map((c) => new THREE.Vector3(...c)));
    scene.add(new THREE.LineLoop(shape, new THREE.LineBasicMaterial({ color: 0x333333 })));
  }
  const shape = new THREE.SphereGeometry(0.014, 12, 8);
  const paint = (colour, open) => new THREE.MeshBasicMaterial({ color: colour, wireframe: open });
  const looks = {
    seen: paint(COLOURS.seen, false),
    filled: paint(COLOURS.filled, true),
    chosen: paint(COLOURS.chosen, false),
    "chosen filled": paint(COLOURS.chosen, true),
  };
  const balls = data.names.map(() => {
    const ball = new THREE.Mesh(shape, looks.seen);
    scene.add(ball);
    return ball;
  });
  const eye = { around: -0.7, up: 0.25, away: 3.8 },
    middle = new THREE.Vector3();
  let frame = 0,
    picked = chosen,
    playing = null;
  const inside = (spans, t) => (spans || []).some(([a, b]) => t >= a - 1e-6 && t <= b + 1e-6);
  const time = () => data.start_s + frame * data.step_s;
  const slider = h("input", {
    type: "range",
    min: 0,
    max: Math.max(0, data.frames - 1),
    value: 0,
    "aria-label": "Frame",
    oninput: () => go(Number(slider.value)),
  });
  const said = h("span", { cls: "small" });

  function draw() {
    const t = time(),
      seen = [];
    balls.forEach((ball, k) => {
      const at = [0, 1, 2].map((i) => places[3 * (frame * many + k) + i]);
      ball.visible = !at.includes(UNKNOWN);
      if (!ball.visible) return;
      ball.position.set(...at.map((value, i) => data.origin[i] + data.unit * value));
      seen.push(ball.position);
      const filled = inside(data.filled[data.names[k]], t);
      ball.material =
        looks[data.names[k] === picked ? (filled ? "chosen filled" : "chosen") : filled ? "filled" : "seen"];
      ball.scale.setScalar(data.names[k] === picked ? 1.7 : 1);
    });
    if (seen.length) {
      middle.set(0, 0, 0);
      seen.forEach((p) => middle.add(p));
      middle.divideScalar(seen.length);
    }
    const word = picked && !balls[data.names.indexOf(picked)]?.visible ? " · not seen" : "";
    said.textContent = `${t.toFixed(2)} s${picked ? ` · ${picked}${word}` : ""}`;
    slider.setAttribute("aria-valuetext", said.textContent);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width) return;
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    const flat = Math.cos(eye.up) * eye.away;
    camera.position
      .copy(middle)
      .add(new THREE.Vector3(flat * Math.cos(eye.around), flat * Math.sin(eye.around), Math.sin(eye.up) * eye.away));
    camera.lookAt(middle);
    renderer.render(scene, camera);
  }
  function go(to) {
    frame = Math.min(Math.max(0, to), Math.max(0, data.frames - 1));
    slider.value = frame;
    draw();
  }

  function pick(event) {
    // the marker nearest to the click, within some pixels
    const box = canvas.getBoundingClientRect(),
      best = { name: "", far: 22 };
    balls.forEach((ball, k) => {
      if (!ball.visible) return;
      const at = ball.position.clone().project(camera);
      const far = Math.hypot(
        ((at.x + 1) / 2) * box.width - (event.clientX - box.left),
        ((1 - at.y) / 2) * box.height - (event.clientY - box.top),
      );
      if (far < best.far) Object.assign(best, { name: data.names[k], far });
    });
    if (best.name) onchoose(best.name);
  }
  let down = null;
  canvas.addEventListener("pointerdown", (event) => {
    down = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!(event.buttons & 1)) return;
    eye.around -= 0.008 * event.movementX;
    eye.up = Math.min(1.55, Math.max(-0.3, eye.up + 0.008 * event.movementY));
    draw();
  });
  canvas.addEventListener("pointerup", (event) => {
    if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 5) pick(event);
    down = null;
  });
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      eye.away = Math.min(15, Math.max(0.8, eye.away * Math.exp(0.001 * event.deltaY)));
      draw();
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === "+" || event.key === "-") eye.away *= event.key === "+" ? 0.9 : 1.1;
    else if (!step) return;
    event.preventDefault();
    if (step) go(frame + step);
    else draw();
  });
  const play = h(
    "button",
    {
      onclick: () => {
        if (playing) {
          clearInterval(playing);
          playing = null;
        } else {
          playing = setInterval(
            () => {
              if (!canvas.isConnected) {
                clearInterval(playing);
                return;
              }
              go(frame + 1 >= data.frames ? 0 : frame + 1);
            },
            1000 * Math.max(data.step_s, 0.02),
          );
        }
        play.textContent = playing ? "Pause" : "Play";
      },
    },
    "Play",
  );
  const looksFrom = [
    ["Front", 0, 0.1],
    ["Side", -Math.PI / 2, 0.1],
    ["Top", -Math.PI / 2, 1.5],
  ].map(([text, around, up]) =>
    h(
      "button",
      {
        onclick: () => {
          Object.assign(eye, { around, up });
          draw();
        },
      },
      text,
    ),
  );
  new ResizeObserver(() => draw()).observe(canvas);
  const element = h(
    "div",
    {},
    canvas,
    h("div", { cls: "bar" }, play, slider, said, looksFrom),
    h(
      "p",
      { cls: "small" },
      "Black: seen. Orange, open: in a gap, as a run would fill it. Pink: chosen. Drag to turn, wheel to come nearer.",
    ),
  );
  return {
    element,
    time,
    go: (t) => go(Math.round((t - data.start_s) / (data.step_s || 1))),
    choose(name) {
      picked = name;
      draw();
    },
  };
}
