// The switch of the theme, printing, keys that zoom, and controls that pick what a picture shows.
const root = document.documentElement, button = document.getElementById("theme");
const dark = matchMedia("(prefers-color-scheme: dark)");
const drawing = () => window.Bokeh?.documents[0];
const plotOf = panel =>
  drawing()?.get_model_by_id(panel.querySelector("[data-root-id]").dataset.rootId);

function show(theme) {
  root.dataset.theme = theme;
  button.setAttribute("aria-pressed", theme === "dark");
  for (const view of window.Bokeh?.index ?? []) { view.invalidate_layout?.(); }
}
show(dark.matches ? "dark" : "light");
dark.addEventListener("change", () => show(dark.matches ? "dark" : "light"));
button.addEventListener("click", () => show(root.dataset.theme === "dark" ? "light" : "dark"));

addEventListener("beforeprint", () => {
  show("light");
  for (const each of document.querySelectorAll("details")) { each.open = true; }
});

function zoom(range, factor, shift) {
  const middle = (range.start + range.end) / 2, half = (range.end - range.start) / 2;
  range.setv({start: middle + half * (shift - factor), end: middle + half * (shift + factor)});
}
const keys = {"+": [0.5, 0], "-": [2, 0], ArrowLeft: [1, -0.5], ArrowRight: [1, 0.5]};
for (const panel of document.querySelectorAll(".panel")) {
  panel.addEventListener("keydown", event => {
    const plot = plotOf(panel);
    if (event.target !== panel || !plot) { return; }
    if (event.key in keys) { zoom(plot.x_range, ...keys[event.key]); }
    else if (event.key === "0") { plot.reset.emit(); }
    else { return; }
    event.preventDefault();
  });
}
for (const control of document.querySelectorAll("[data-line-of]")) {
  control.addEventListener("input", () => {
    const line = drawing().get_model_by_name(`line of ${control.dataset.lineOf}`);
    const [bottom, top] = line.tags;
    line.location = bottom + (top - bottom) * (control.value - 0.5) / control.max;
    control.nextElementSibling.value = control.value;
  });
}
for (const control of document.querySelectorAll("[data-variant-of]")) {
  control.addEventListener("change", () => {
    const name = control.dataset.variantOf;
    for (const panel of document.querySelectorAll(`.panel[data-picture="${name}"]`)) {
      const plot = plotOf(panel);
      plot.renderers.forEach((each, number) => {
        const other = plot.tags.find(tag => tag.name === `${control.value}/${number}`);
        if (other) { each.data_source.data = other.data; }
      });
    }
  });
}
