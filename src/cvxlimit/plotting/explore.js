// A load domain with a load point to drag, sliders, and the mechanism beside it.
const SIZE = 320, PAD = 34;
const make = (name, parent, attributes = {}) => {
  const svg = ["svg", "polygon", "circle", "line", "text"].includes(name);
  const node = svg
    ? document.createElementNS("http://www.w3.org/2000/svg", name)
    : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (parent) parent.append(node);
  return node;
};

function render({ model, el }) {
  const row = make("div", el, { style: "display:flex;gap:16px;flex-wrap:wrap;align-items:flex-start" });
  const left = make("div", row), right = make("div", row);
  const svg = make("svg", left, {
    width: SIZE, height: SIZE, style: "touch-action:none;cursor:crosshair;background:#fff",
  });
  const image = make("img", right, { style: "max-width:380px;max-height:320px;background:#fff" });
  const text = make("div", right, { style: "max-width:380px;font:13px system-ui,sans-serif" });
  let box, waits = false, next = null;
  const out = ([x, y]) => [
    PAD + ((x - box[0][0]) / (box[1][0] - box[0][0])) * (SIZE - 2 * PAD),
    SIZE - PAD - ((y - box[0][1]) / (box[1][1] - box[0][1])) * (SIZE - 2 * PAD),
  ];
  const back = (u, v) => [
    box[0][0] + ((u - PAD) / (SIZE - 2 * PAD)) * (box[1][0] - box[0][0]),
    box[0][1] + ((SIZE - PAD - v) / (SIZE - 2 * PAD)) * (box[1][1] - box[0][1]),
  ];
  function send(name, value) {  // one question at a time: the last one asked meanwhile comes next
    if (waits) { next = [name, value]; return; }
    if (JSON.stringify(model.get(name)) === JSON.stringify(value)) return;
    waits = true;
    model.set(name, value);
    model.save_changes();
  }
  function draw() {
    const state = model.get("state");
    box = state.box;
    svg.replaceChildren();
    const ring = (points, style) => points.length &&
      make("polygon", svg, { points: points.map((p) => out(p).join()).join(" "), style });
    ring(state.outside, "fill:#134b7329;stroke:#134b73;stroke-dasharray:4 3");
    ring(state.inside, "fill:#134b7373;stroke:#134b73");
    const [x, y] = out([0, 0]), [u, v] = out(model.get("point"));
    make("line", svg, { x1: PAD, x2: SIZE - PAD, y1: y, y2: y, stroke: "#999" });
    make("line", svg, { x1: x, x2: x, y1: PAD, y2: SIZE - PAD, stroke: "#999" });
    make("line", svg, { x1: x, y1: y, x2: u, y2: v, stroke: "#d62246" });
    make("circle", svg, { cx: u, cy: v, r: 6, fill: "#d62246" });
    const label = (at, words) => {
      make("text", svg, { ...at, "font-size": 12, "text-anchor": "middle" }).textContent = words;
    };
    label({ x: SIZE / 2, y: SIZE - 10 }, state.names[0]);
    label({ x: 14, y: SIZE / 2, transform: `rotate(-90 14 ${SIZE / 2})` }, state.names[1]);
    text.textContent = state.text;
    image.style.display = state.picture ? "" : "none";
    if (state.picture) image.src = "data:image/png;base64," + state.picture;
    if (!state.is_last) return;
    waits = false;
    if (next) { const [name, value] = next; next = null; send(name, value); }
  }
  const drag = (event) => {
    if (!event.buttons) return;
    const at = svg.getBoundingClientRect();
    send("point", back(event.clientX - at.left, event.clientY - at.top));
  };
  svg.addEventListener("pointerdown", (event) => { svg.setPointerCapture(event.pointerId); drag(event); });
  svg.addEventListener("pointermove", drag);
  for (const { name, low, high } of model.get("sliders")) {
    const line = make("label", left, { style: "display:block;font:13px system-ui,sans-serif" });
    const shown = make("span", line, { style: "display:inline-block;min-width:150px" });
    const slider = make("input", line, { type: "range", min: low, max: high, step: (high - low) / 100 });
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
