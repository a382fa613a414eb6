// Shows the frames of the stream, draws the traces that are chosen, and sends what is pressed.
"use strict";
const SPAN_S = 30, OLD_MS = 1500, CONFIRM_MS = 2000, DRAW_MS = 250;
const $ = (id) => document.getElementById(id);
const traces = new Map(); // name -> { unit, x, y }
let chosen = new Set(JSON.parse(localStorage.getItem("traces") || "[]"));
let socket, newest = 0, stopAsked = 0, ended = false;

function connect() {
  socket = new WebSocket(`ws://${location.host}/stream${location.search}`);
  socket.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (message.ended) { ended = true; return; }
    if (!message.frame) traces.clear();
    message.traces.forEach(take);
    if (message.frame) { newest = Date.now(); write(message.frame); }
  };
  socket.onclose = () => setTimeout(connect, 1000);
}

function take({ time_s, values, units }) {
  for (const [name, y] of Object.entries(values)) {
    const trace = traces.get(name) || { unit: units[name], x: [], y: [] };
    traces.set(name, trace);
    if (time_s[0] < trace.x.at(-1)) trace.x = [], trace.y = []; // the device's clock restarted
    trace.x.push(...time_s);
    trace.y.push(...y);
    const old = trace.x.findIndex((x) => x >= time_s.at(-1) - SPAN_S);
    trace.x.splice(0, old);
    trace.y.splice(0, old);
  }
}

function list(id, items) {
  $(id).replaceChildren(...items.map((parts) => {
    const line = document.createElement("li");
    line.append(...parts);
    return line;
  }));
}

function styled(text, style) {
  const part = document.createElement("span");
  part.textContent = text;
  part.className = style;
  return part;
}

function write(frame) {
  for (const id of ["title", "time", "rate", "lost", "name", "unit", "interval"]) $(id).textContent = frame[id];
  document.title = frame.title;
  $("lost").className = frame.lost.startsWith("LOST") ? "bad" : "";
  $("flagged").textContent = frame.flagged && `flagged in 10 s: ${frame.flagged}`;
  $("number").textContent = frame.number ?? "–";
  $("missing").textContent = frame.number === null ? `no value: ${frame.missing}` : "";
  list("beside", frame.beside.map((note) => [note]));
  list("devices", frame.devices.map(({ name, state, detail, mark }) =>
    [styled(`${mark[0]} ${name} ${state}`, mark[1]), detail ? `  ${detail}` : ""]));
  list("limits", frame.limits.map(({ name, text, share, style }) => {
    const bar = document.createElement("meter");
    Object.assign(bar, { min: 0, max: 1, high: 0.8, value: share, ariaLabel: name });
    return [bar, ` ${name} `, styled(text, style)];
  }));
  const stopped = frame.devices.find(({ name }) => name === "stop");
  const armed = frame.devices.some(({ name, state }) => name === "logger" && state === "armed");
  if (stopAsked && stopped && !armed) {
    stopAsked = 0;
    $("stopping").textContent = `Stopped: disarmed, ${stopped.detail}.`;
  }
  if (!chosen.size) chosen = new Set([frame.main, `${frame.main}, estimate`]);
}

function watch() {
  const age = Date.now() - newest;
  document.body.classList.toggle("old", age > OLD_MS);
  if (newest && age > OLD_MS) $("link").textContent = ended ? "The session has ended. The values are old."
    : `No data for ${Math.round(age / 1000)} s. The values are old.`;
  if (stopAsked && Date.now() - stopAsked > CONFIRM_MS)
    $("stopping").textContent = "NOT CONFIRMED. Cut the motor supply by hand.";
}

function draw() {
  offer();
  const byUnit = new Map();
  for (const name of chosen) if (traces.has(name)) {
    const { unit } = traces.get(name);
    byUnit.set(unit, [...(byUnit.get(unit) || []), name]);
  }
  const ink = getComputedStyle(document.body).color;
  for (const plot of [...$("plots").children]) if (!byUnit.has(plot.dataset.unit)) plot.remove();
  for (const [unit, names] of byUnit) {
    let plot = [...$("plots").children].find((one) => one.dataset.unit === unit);
    if (!plot) {
      plot = document.createElement("div");
      plot.dataset.unit = unit;
      $("plots").append(plot);
    }
    const lines = names.map((name) => ({ name, x: traces.get(name).x, y: traces.get(name).y, mode: "lines", line: { width: 1.5 } }));
    const axis = { gridcolor: "#8884", automargin: true };
    Plotly.react(plot, lines, { height: 260, margin: { l: 60, r: 10, t: 10, b: 40 }, uirevision: unit,
      datarevision: newest,
      paper_bgcolor: "transparent", plot_bgcolor: "transparent", font: { color: ink },
      showlegend: true, legend: { orientation: "h", y: 1.15 }, xaxis: { ...axis, title: { text: "time, s" } },
      yaxis: { ...axis, title: { text: unit } } }, { displaylogo: false, responsive: true });
  }
}

function offer() {
  const names = [...traces.keys()];
  if (names.join() === $("names").dataset.names) return;
  $("names").dataset.names = names.join();
  $("names").replaceChildren(...names.map((name) => {
    const box = document.createElement("input"), label = document.createElement("label");
    Object.assign(box, { type: "checkbox", checked: chosen.has(name), name });
    box.onchange = () => {
      box.checked ? chosen.add(name) : chosen.delete(name);
      localStorage.setItem("traces", JSON.stringify([...chosen]));
    };
    label.append(box, ` ${name}`);
    return label;
  }));
}

for (const button of document.querySelectorAll("[data-action]"))
  button.onclick = () => {
    if (button.id === "stop") { stopAsked = Date.now(); $("stopping").textContent = "Stopping ..."; }
    if (socket.readyState === WebSocket.OPEN) socket.send(button.dataset.action);
  };
connect();
setInterval(watch, 250);
setInterval(draw, DRAW_MS);
