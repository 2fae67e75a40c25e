/* numbers along axes, for pages and for the widget */
function tickStep(range, most) {
  const raw = range / Math.max(most, 1), power = 10 ** Math.floor(Math.log10(raw));
  return power * [1, 2, 2.5, 5, 10].find((m) => m * power >= raw * 0.999999);
}
function ticksOf(low, high, step) {
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * (high - low); i++)
    found.push([i * step, String(Number((i * step).toPrecision(10)))]);
  return found;
}
