"use strict";
// Sets the colours of the figures for light or dark mode.
(() => {
  function paint() {
    const style = getComputedStyle(document.documentElement);
    const [ink, quiet, line] = ["--ink", "--quiet", "--line"].map((name) => style.getPropertyValue(name).trim());
    const figures = Bokeh.documents.flatMap((each) => each.roots()).filter((root) => root.type === "Figure");
    for (const plot of figures) {
      for (const part of [...plot.left, ...plot.below]) {
        part.setv({
          axis_label_text_color: quiet, axis_label_text_font_style: "normal", major_label_text_color: ink,
          axis_line_color: line, major_tick_line_color: line, minor_tick_line_color: null,
        });
      }
      for (const part of plot.center) {
        if (part.type === "Grid") part.setv({ grid_line_color: line });
        if (part.type === "Legend") part.setv({ label_text_color: ink });
      }
    }
    return figures.length;
  }
  const first = setInterval(() => {
    if (window.Bokeh && paint()) {
      clearInterval(first);
      document.documentElement.dataset.ready = "yes";
    }
  }, 50);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
})();
