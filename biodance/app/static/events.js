// Foot strikes and offs on the time line: chosen, moved, added and taken out, by pointer and by keyboard.
import { h, say } from "./dom.js";

export const SIDES = { left: "#b3261e", right: "#0058a3" };
const BY = { force: "by the plates", markers: "by the markers", hand: "set by hand" };
const PAUSE = 500; // ms without a key after which what was moved is written
let draft = null; // {name, trial, revision, events}: what session.toml does not take yet

const before = (a, b) => a.time_s - b.time_s;
export const called = (one) => `${one.side} ${one.down ? "strike" : "off"}`;

export function eventsOf({ name, view }, row, moved) {
  // what is shown: the draft, else what session.toml says of a foot, else what the last run found of it
  if (isDraft({ name, view }, row)) return draft.events;
  const told = new Set(row.events.map((one) => one.side));
  const found = (moved?.events || []).filter((one) => !told.has(one.side) && one.source !== "hand");
  return [...found, ...row.events].map((one) => ({ ...one })).sort(before);
}

export function isDraft({ name, view }, row) {
  return draft?.name === name && draft.trial === row.name && draft.revision === view.revision;
}

export function discard() {
  draft = null;
}

export class EventEditor {
  // the events of one recording: `changed` draws them anew, `save` writes them
  constructor(all, row, moved, [begin, end], redraw) {
    Object.assign(this, { all, row, begin, end, redraw, chosen: null, timer: 0 });
    this.events = eventsOf(all, row, moved);
    this.frame = 1 / (row.rate_hz || 100);
  }

  key(one) {
    const same = this.events.filter((other) => called(other) === called(one));
    return `event ${called(one)} ${same.indexOf(one)}`;
  }

  set(events, side) {
    // all events of a foot are by hand as soon as one of them is
    this.events = events
      .map((one) => (one.side === side && one.source !== "hand" ? Object.assign(one, { source: "hand" }) : one))
      .sort(before);
    const { name, view } = this.all;
    draft = { name, trial: this.row.name, revision: view.revision, events: this.events };
  }

  move(one, time) {
    one.time_s = this.inside(time);
    this.set(this.events, one.side);
    this.redraw(this.key(one));
  }

  inside(time) {
    return Math.min(this.end, Math.max(this.begin, Number(time.toFixed(4))));
  }

  add(side, down, time) {
    const one = { side, down, time_s: this.inside(time), source: "hand" };
    this.set([...this.events, one], side);
    return this.save();
  }

  remove(one) {
    const rest = this.events.filter((other) => other !== one);
    if (!rest.some((other) => other.side === one.side))
      return say("This is the last event of the foot. To use none of its steps, leave the span out for this foot.");
    this.set(rest, one.side);
    return this.save();
  }

  later() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.save(), PAUSE);
  }

  save() {
    clearTimeout(this.timer);
    const hand = this.events.filter((one) => one.source === "hand");
    const told = hand.map((one) => ({ side: one.side, kind: one.down ? "strike" : "off", time: one.time_s }));
    return this.all.edit([["trials", this.row.stem, "events"], told]);
  }

  pressed(one, event) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step) {
      this.move(one, one.time_s + step * this.frame);
      this.later();
    } else if (event.key === "Delete" || event.key === "Backspace") this.remove(one);
    else return;
    event.preventDefault();
  }

  mark(one, x, y, timeAt) {
    // a triangle that can be taken: down a strike, up an off; full by a plate or by hand, open by the markers
    const up = one.down ? 1 : -1,
      at = x(one.time_s);
    const said = `${called(one)} at ${one.time_s.toFixed(3)} s, ${BY[one.source]}`;
    const shape = h(
      "path",
      {
        d: `M${at} ${y + 5 * up}l-5 ${-10 * up}h10z`,
        stroke: one.source === "hand" ? "#1b1b1b" : SIDES[one.side],
        "stroke-width": 1.5,
        fill: one.source === "markers" ? "#fff" : SIDES[one.side],
      },
      h("title", {}, said),
    );
    const area = h("rect", { x: at - 9, y: y - 8, width: 18, height: 16, fill: "transparent" });
    const mark = h(
      "g",
      {
        tabindex: "0",
        role: "button",
        cls: "event",
        "data-key": this.key(one),
        "aria-label": `${said}. Arrow keys move it by a frame, Delete takes it out.`,
        onkeydown: (event) => this.pressed(one, event),
      },
      area,
      shape,
    );
    mark.addEventListener("pointerdown", (event) => {
      event.stopPropagation();
      event.preventDefault();
      this.drag(one, event, timeAt);
    });
    return mark;
  }

  drag(one, down, timeAt) {
    // until the pointer is let go; a press without a way chooses alone
    const start = down.clientX;
    let moved = false;
    const go = (event) => {
      moved = moved || Math.abs(event.clientX - start) > 2;
      if (moved) this.move(one, this.begin + Math.round((timeAt(event) - this.begin) / this.frame) * this.frame);
    };
    const end = () => {
      removeEventListener("pointermove", go);
      removeEventListener("pointerup", end);
      removeEventListener("pointercancel", end);
      if (moved) this.save();
    };
    this.redraw(this.key(one));
    addEventListener("pointermove", go);
    addEventListener("pointerup", end);
    addEventListener("pointercancel", end);
  }
}
