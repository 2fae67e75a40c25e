// A load domain with a load point to drag, sliders, and the mechanism beside it.
const SIZE = 360, LEFT = 52, RIGHT = 10, TOP = 10, FOOT = 40;
const STYLE = `
.cvxlimit { --paper: #ffffff; --ink: #23272e; --soft: #5c636e; --edge: #c4c9d0; --set: #134b73;
  display: flex; flex-wrap: wrap; gap: 16px; align-items: flex-start; padding: 8px;
  font: 13px/1.4 system-ui, "DejaVu Sans", sans-serif; color: var(--ink); background: var(--paper); }
@media (prefers-color-scheme: dark) {
  .cvxlimit { --paper: #14171c; --ink: #e6e8eb; --soft: #a9b0ba; --edge: #4a515c; --set: #7fb3d6; } }
.cvxlimit > div { flex: 1 1 300px; min-width: 0; max-width: 400px; }
.cvxlimit svg { display: block; width: 100%; touch-action: none; cursor: crosshair; }
.cvxlimit svg:focus-visible { outline: 2px solid var(--set); }
.cvxlimit text { fill: var(--ink); font-size: 12px; text-anchor: middle; }
.cvxlimit line { stroke: var(--edge); }
.cvxlimit polygon { fill: var(--set); fill-opacity: 0.45; }
.cvxlimit .outside { fill-opacity: 0.16; }
.cvxlimit .edge { stroke: var(--set); }
.cvxlimit .ruled { stroke-dasharray: 4 3; }
.cvxlimit .load { stroke: #d62246; fill: #d62246; }
.cvxlimit img { max-width: 100%; max-height: 320px; background: #fff; border-radius: 4px; }
.cvxlimit label { display: block; margin-top: 6px; }
.cvxlimit input { width: 100%; margin: 2px 0; }
.cvxlimit p { margin: 6px 0; overflow-wrap: anywhere; }`;
const SVG = ["svg", "g", "polygon", "circle", "line", "text"];
const make = (name, parent, attributes = {}) => {
  const node = SVG.includes(name)
    ? document.createElementNS("http://www.w3.org/2000/svg", name)
    : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (parent) parent.append(node);
  return node;
};

function render({ model, el }) {
  make("style", el).textContent = STYLE;
  const row = make("div", el, { class: "cvxlimit" });
  const left = make("div", row), right = make("div", row);
  const svg = make("svg", left, {
    viewBox: `0 0 ${SIZE} ${SIZE}`, tabindex: 0, role: "application",
    "aria-label": "load domain; drag the load point, or move it by arrow keys",
  });
  const image = make("img", right, { alt: "the mechanism under the load point" });
  const text = make("p", right, { role: "status" });
  // the frame stays where it is, whatever sliders do to the domain
  const [low, high] = model.get("state").box, wide = SIZE - LEFT - RIGHT, tall = SIZE - TOP - FOOT;
  const out = ([x, y]) => [
    LEFT + ((x - low[0]) / (high[0] - low[0])) * wide,
    SIZE - FOOT - ((y - low[1]) / (high[1] - low[1])) * tall,
  ];
  const back = ([u, v]) => [
    low[0] + ((u - LEFT) / wide) * (high[0] - low[0]),
    low[1] + ((SIZE - FOOT - v) / tall) * (high[1] - low[1]),
  ].map((x, i) => Math.max(low[i], Math.min(high[i], x)));
  let waits = false, next = null;
  function send(name, value) {  // one question at a time: the last one asked meanwhile comes next
    if (waits) { next = [name, value]; return; }
    if (JSON.stringify(model.get(name)) === JSON.stringify(value)) return;
    waits = true;
    model.set(name, value);
    model.save_changes();
  }
  function drawFrame(names) {
    const line = (a, b) => make("line", svg, { x1: a[0], y1: a[1], x2: b[0], y2: b[1] });
    const word = (x, y, words, more = {}) => { make("text", svg, { x, y, ...more }).textContent = words; };
    const zero = out([0, 0]), foot = SIZE - FOOT;
    line([LEFT, zero[1]], [SIZE - RIGHT, zero[1]]);
    line([zero[0], TOP], [zero[0], foot]);
    line([LEFT, foot], [SIZE - RIGHT, foot]);
    line([LEFT, TOP], [LEFT, foot]);
    for (const [x, words] of ticksOf(low[0], high[0], tickStep(high[0] - low[0], wide / 36))) {
      const at = out([x, 0])[0];
      line([at, foot], [at, foot + 5]);
      word(at, foot + 18, words);
    }
    for (const [y, words] of ticksOf(low[1], high[1], tickStep(high[1] - low[1], tall / 36))) {
      const at = out([0, y])[1];
      line([LEFT - 5, at], [LEFT, at]);
      word(LEFT - 8, at + 4, words, { style: "text-anchor: end" });
    }
    word(LEFT + wide / 2, SIZE - 6, names[0]);
    word(12, TOP + tall / 2, names[1], { transform: `rotate(-90 12 ${TOP + tall / 2})` });
  }
  function draw() {
    const state = model.get("state");
    svg.replaceChildren();
    // no line where the frame alone ends a set
    const ends = (p, q) => [0, 1].some((i) => [low[i], high[i]].some(
      (end) => Math.abs(p[i] - end) + Math.abs(q[i] - end) < 1e-9 * (high[i] - low[i])));
    const ring = (points, kind, edge) => {
      make("polygon", svg, { points: points.map((p) => out(p).join()).join(" "), class: kind });
      points.forEach((p, i) => {
        const q = points[(i + 1) % points.length], [[x1, y1], [x2, y2]] = [out(p), out(q)];
        if (!ends(p, q)) make("line", svg, { x1, y1, x2, y2, class: edge });
      });
    };
    ring(state.outside, "outside", "edge ruled");
    ring(state.inside, "inside", "edge");
    drawFrame(state.names);
    const [x, y] = out([0, 0]), [u, v] = out(model.get("point"));
    make("line", svg, { x1: x, y1: y, x2: u, y2: v, class: "load" });
    make("circle", svg, { cx: u, cy: v, r: 6, class: "load" });
    text.textContent = state.text;
    image.style.display = state.picture ? "" : "none";
    if (state.picture) image.src = "data:image/png;base64," + state.picture;
    if (!state.is_last) return;
    waits = false;
    if (next) { const [name, value] = next; next = null; send(name, value); }
  }
  const drag = (event) => {
    if (!event.buttons) return;
    const box = svg.getBoundingClientRect(), scale = SIZE / box.width;
    send("point", back([(event.clientX - box.left) * scale, (event.clientY - box.top) * scale]));
  };
  svg.addEventListener("pointerdown", (event) => { svg.setPointerCapture(event.pointerId); drag(event); });
  svg.addEventListener("pointermove", drag);
  svg.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!by) return;
    event.preventDefault();
    const [u, v] = out(next && next[0] === "point" ? next[1] : model.get("point"));
    send("point", back([u + by[0] * wide / 50, v + by[1] * tall / 50]));
  });
  for (const { name, low: least, high: most } of model.get("sliders")) {
    const line = make("label", left), shown = make("span", line);
    const slider = make("input", line, { type: "range", min: least, max: most, step: (most - least) / 100 });
    const told = () => { shown.textContent = `${name} ${(+slider.value).toPrecision(3)}`; };
    slider.value = model.get("values")[name];
    told();
    slider.addEventListener("input", () => {
      told();
      send("values", { ...model.get("values"), ...(next && next[0] === "values" ? next[1] : {}), [name]: +slider.value });
    });
  }
  model.on("change:state", draw);
  draw();
}
export default { render };
