// Draws the charts of a page from the JSON in it: colours of the scheme, runs and sides that can be
// hidden, a run that can be chosen, export for a document, and paper. Nothing is fetched.
"use strict";
(() => {
  const charts = JSON.parse(document.getElementById("charts").textContent);
  const scheme = matchMedia("(prefers-color-scheme: dark)");
  const schemes = {
    light: { ink: "#1c1e21", grid: "#d5d8dc", before: "#c4500b", after: "#0b6fb3", measured: "#5f6670", level: "#5f6670",
      channel0: "#3a6f37", channel1: "#c4500b", channel2: "#7a3fa0", channel3: "#8a6d00", channel4: "#b3194b", channel5: "#5f6670" },
    dark: { ink: "#e6e8eb", grid: "#43484f", before: "#ff9950", after: "#5cb8f5", measured: "#aab2bd", level: "#aab2bd",
      channel0: "#86c67c", channel1: "#ff9950", channel2: "#c79be8", channel3: "#d9b93a", channel4: "#ff7f9f", channel5: "#aab2bd" },
  };
  const places = { before: "dot", after: "solid", measured: "solid", level: "dash" };
  let printing = false;

  const theme = () => {
    const asked = document.documentElement.dataset.scheme;
    if (printing) return schemes.light;
    return schemes[asked || (scheme.matches ? "dark" : "light")];
  };
  const faded = (colour, share) =>
    colour + Math.round(255 * share).toString(16).padStart(2, "0");

  // which sides and runs are shown
  const hidden = { side: new Set(), run: new Set() };
  const chosen = {};

  function drawn(chart, colours) {
    const lines = chart.name in chosen ? chart.choices[chosen[chart.name]] : chart.lines;
    return lines.map((line) => {
      const { role, run, band } = line.meta;
      const colour = colours[role];
      const one = { ...line, visible: !(hidden.side.has(role) || (run && hidden.run.has(run))) };
      if (line.type === "bar") {
        one.marker = { color: role === "before" ? faded(colour, 0.55) : colour,
          line: { color: colour, width: 1 } };
      } else if (line.mode === "markers") {
        one.marker = { color: colour, size: 7 };
        if (line.error_y) one.error_y = { ...line.error_y, color: colour };
      } else if (band) {
        one.line = { width: 0 };
        one.fillcolor = faded(colour, 0.22);
      } else {
        const width = run && !chart.name.startsWith("time") ? 0.8 : 1.6;
        const thin = chart.name.startsWith("time");
        one.line = { color: colour, width, dash: thin ? "solid" : places[role] };
        if (run && !thin) one.opacity = 0.45;
      }
      return one;
    });
  }

  function arranged(chart, colours, title) {
    const axis = { gridcolor: colours.grid, zerolinecolor: colours.ink, zerolinewidth: 1,
      linecolor: colours.ink, ticks: "outside", tickcolor: colours.ink, automargin: true };
    const layout = { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { color: colours.ink, size: 13, family: "system-ui, sans-serif" },
      margin: { l: 64, r: 16, t: title ? 56 : 28, b: 48 }, hovermode: "x unified",
      hoverlabel: { bgcolor: colours === schemes.dark ? "#23272e" : "#ffffff", font: { color: colours.ink } },
      legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", traceorder: "normal" },
      height: 360,
      barmode: "group", dragmode: "zoom", ...chart.layout };
    for (const name of Object.keys(layout)) {
      if (/^[xy]axis/.test(name)) layout[name] = { ...axis, ...layout[name] };
    }
    if (title) layout.title = { text: title, font: { size: 16 }, x: 0.02, xanchor: "left", y: 0.97, yanchor: "top" };
    return layout;
  }

  const settings = { responsive: true, displaylogo: false,
    modeBarButtonsToRemove: ["toImage", "select2d", "lasso2d"] };

  const place = (chart) => document.getElementById("chart-" + chart.name);
  const draw = (chart) => {
    const layout = arranged(chart, theme());
    if (printing) layout.width = 660;
    else layout.autosize = true;
    return Plotly.react(place(chart), drawn(chart, theme()), layout, settings);
  };
  const drawAll = () => Promise.all(charts.map(draw));

  async function save(chart, format) {
    const title = chart.title + (chart.name in chosen ? ": " + chosen[chart.name] : "");
    const layout = { ...arranged(chart, schemes.light, title), paper_bgcolor: "#ffffff" };
    const url = await Plotly.toImage({ data: drawn(chart, schemes.light), layout },
      { format, width: 900, height: chart.layout.height || 420, scale: format === "png" ? 3 : 1 });
    const link = document.createElement("a");
    link.href = url;
    link.download = chart.name + "." + format;
    link.click();
  }

  for (const chart of charts) {
    const figure = place(chart).closest("figure");
    for (const button of figure.querySelectorAll("button[data-format]")) {
      button.addEventListener("click", () => save(chart, button.dataset.format));
    }
    figure.querySelector("button[data-reset]").addEventListener("click", () => {
      const changes = {};
      for (const name of Object.keys(place(chart).layout)) {
        if (/^[xy]axis/.test(name)) changes[name + ".autorange"] = true;
      }
      Plotly.relayout(place(chart), changes);
    });
    const choice = figure.querySelector("select");
    if (choice) {
      chosen[chart.name] = choice.value;
      choice.addEventListener("change", () => { chosen[chart.name] = choice.value; draw(chart); });
    }
  }
  for (const box of document.querySelectorAll("input[data-side], input[data-run]")) {
    box.addEventListener("change", () => {
      const [kind, name] = "side" in box.dataset ? ["side", box.dataset.side] : ["run", box.dataset.run];
      if (box.checked) hidden[kind].delete(name);
      else hidden[kind].add(name);
      drawAll();
    });
  }
  const button = document.getElementById("scheme");
  button.addEventListener("click", () => {
    const dark = theme() === schemes.dark;
    document.documentElement.dataset.scheme = dark ? "light" : "dark";
    drawAll();
  });
  scheme.addEventListener("change", drawAll);
  addEventListener("beforeprint", () => { printing = true; drawAll(); });
  addEventListener("afterprint", () => { printing = false; drawAll(); });
  drawAll().then(() => { document.documentElement.dataset.drawn = "yes"; });
})();
