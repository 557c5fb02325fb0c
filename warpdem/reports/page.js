"use strict";
// Values under the pointer, or at the arrow keys; and the button for light and dark. The page is whole without it.
for (const figure of document.querySelectorAll(".chart")) {
  const data = JSON.parse(figure.querySelector('script[type="application/json"]').textContent);
  const plot = figure.querySelector(".plot");
  const cursor = figure.querySelector(".cursor");
  const readout = figure.querySelector(".readout");
  const unit = figure.querySelector("figcaption").textContent.match(/\[[^\]]*\]$/);
  const [left, right, width] = data.frame;
  const [low, high] = data.range;
  let at = -1;

  function show(index) {
    at = Math.max(0, Math.min(data.x.length - 1, index));
    const x = left + (right - left) * (data.x[at] - low) / (high - low || 1);
    cursor.setAttribute("x1", x);
    cursor.setAttribute("x2", x);
    cursor.style.visibility = "visible";
    const values = data.curves.map(([name, y]) => name + " " + (y[at] === null ? "–" : y[at]));
    readout.textContent = data.x[at] + ": " + values.join(", ") + (unit ? " " + unit[0] : "");
  }

  function nearest(x) {
    let best = 0;
    for (let k = 1; k < data.x.length; k += 1) {
      if (Math.abs(data.x[k] - x) < Math.abs(data.x[best] - x)) best = k;
    }
    return best;
  }

  plot.addEventListener("pointermove", (event) => {
    const box = plot.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width * width;
    show(nearest(low + (high - low) * (x - left) / (right - left)));
  });
  plot.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: -1, ArrowRight: 1, Home: -Infinity, End: Infinity, PageUp: -20, PageDown: 20 };
    if (event.key in steps) {
      show(steps[event.key] === -Infinity ? 0 : steps[event.key] === Infinity ? data.x.length - 1 : at + steps[event.key]);
      event.preventDefault();
    }
  });
}

document.getElementById("theme").addEventListener("click", () => {
  const root = document.documentElement;
  const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = dark ? "light" : "dark";
});
