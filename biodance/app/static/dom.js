// What every part of the window needs: elements, questions to the server, and one place for what must be said.

export function h(tag, props = {}, ...children) {
  // an element; "on..." are listeners, null children are left out
  const one =
    tag === "svg" || h.svg.has(tag)
      ? document.createElementNS("http://www.w3.org/2000/svg", tag)
      : document.createElement(tag);
  for (const [key, value] of Object.entries(props)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) one.addEventListener(key.slice(2), value);
    else if (key === "value" || key === "checked") one[key] = value;
    else one.setAttribute(key === "cls" ? "class" : key, value === true ? "" : value);
  }
  return put(one, ...children);
}

export function put(place, ...children) {
  place.append(
    ...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false),
  );
  return place;
}
h.svg = new Set(["g", "path", "polygon", "polyline", "line", "rect", "circle", "text", "title"]);

export function say(sentence) {
  // what went wrong, where everybody sees and hears it; "" takes it away
  const place = document.getElementById("said");
  place.hidden = !sentence;
  place.replaceChildren(
    sentence ? h("span", {}, sentence) : "",
    sentence ? h("button", { onclick: () => say("") }, "Close") : "",
  );
}

export async function ask(path, query = {}) {
  return answered(await reached(`/api/${path}?${new URLSearchParams(query)}`, {}));
}

export async function tell(path, body) {
  const headers = { "Content-Type": "application/json" };
  return answered(await reached(`/api/${path}`, { method: "POST", headers, body: JSON.stringify(body) }));
}

export async function reached(address, options) {
  try {
    return await fetch(address, options);
  } catch {
    throw Object.assign(
      new Error("biodance app does not answer. Is it still running? Nothing that you changed is lost."),
      { gone: true },
    );
  }
}

export async function answered(response) {
  const text = await response.text();
  let found = null;
  try {
    found = JSON.parse(text);
  } catch {
    found = { error: text };
  }
  if (!response.ok) throw Object.assign(new Error(found.error), { status: response.status });
  return found;
}

export const number = (value, digits = 1) => (value === null || value === undefined ? "–" : value.toFixed(digits));
export const words = (name) =>
  name.replace("trunk_head", "trunk with head").replace("forearm_hand", "forearm with hand").replaceAll("_", " ");
export const counted = (count, one, many = `${one}s`) => `${count} ${count === 1 ? one : many}`;
export const chip = (text, kind = "") => h("span", { cls: `chip ${kind}` }, text);

export function download(query, text) {
  return h("a", { cls: "button", href: `/download?${new URLSearchParams(query)}`, download: true }, text);
}

const VERDICTS = {
  "nothing wrong": ["nothing wrong", "good"],
  "named, complete": ["cause found", "look"],
  "named, incomplete": ["cause found, more is open", "look"],
  unexplained: ["cause not known", "look"],
};
const STATES = { done: "good", "needs a person": "look", refused: "bad", failed: "bad" };

export function chips(found) {
  // how a session stands, from its last run
  if (!found) return [chip("not run")];
  const shown = [];
  if (!found.fresh) shown.push(chip("changed since the run", "look"));
  shown.push(chip(found.status, STATES[found.status] || ""));
  if (found.verdict) shown.push(" ", chip(...(VERDICTS[found.verdict] || [found.verdict, "look"])));
  return shown.flatMap((one) => [one, " "]);
}
