"use strict";
(async () => {
  // Figures and library stand in the page as text: gzip in base64. The library's own hash lets it run.
  const unpacked = (element) => {
    const bytes = Uint8Array.from(atob(element.textContent), (letter) => letter.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  };
  const root = document.documentElement;
  const page = JSON.parse(await unpacked(document.getElementById("figures")));
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const touch = matchMedia("(pointer: coarse)").matches;
  const PRINTED = { one: 690, two: 335 }; // CSS pixels of A4 less its margins
  const config = {
    responsive: true, displaylogo: false, scrollZoom: false,
    displayModeBar: "hover",
    modeBarButtons: [["zoom2d", "pan2d", "autoScale2d", "resetScale2d", "toImage"]],
  };
  const [LETTER, LINE, CELL, FRAME, BARRED] = [6.4, 13, 34, 70, 190]; // pixels; the last two: axes, with a colour bar
  const drawn = new Map();
  const off = [...document.querySelectorAll('.legend button[aria-pressed="false"]')];
  const hidden = new Set(off.map(({ dataset }) => dataset.figure + " " + dataset.group));
  let syncing = false;

  // A token @name/opacity under a key that names a colour becomes the theme's colour.
  const colour = (token, style) => {
    const [name, opacity] = token.slice(1).split("/");
    const value = style.getPropertyValue("--" + name).trim();
    if (!opacity) return value;
    const parts = [1, 3, 5].map((at) => parseInt(value.slice(at, at + 2), 16));
    return `rgba(${parts.join(",")},${opacity})`;
  };
  const paint = (value, key, style) => {
    if (typeof value === "string") return /color/i.test(key) && value[0] === "@" ? colour(value, style) : value;
    if (Array.isArray(value)) return value.map((item) => paint(item, key, style));
    if (value === null || typeof value !== "object") return value;
    if ("bdata" in value) return { ...value, bdata: page.arrays[value.bdata] };
    return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, paint(item, name, style)]));
  };
  const painted = (panel, width) => {
    const style = getComputedStyle(root);
    const layout = paint({ template: page.template, ...panel.layout }, "", style);
    layout.height = panel.height;
    layout.uirevision = "kept";
    if (touch) layout.dragmode = false; // a finger scrolls the page
    if (width) Object.assign(layout, { width, autosize: false });
    const traces = paint(panel.traces, "", style);
    const room = width || document.getElementById(panel.id).clientWidth;
    const names = layout.annotations || [];
    const free = room - (traces[0].type === "heatmap" ? BARRED : FRAME);
    const long = LETTER * Math.max(0, ...names.map(({ text }) => text.length));
    if (free < (long + LETTER) * names.length) { // names of logs stand upright; each so many where even then there is no room
      const each = Math.ceil(LINE * names.length / free);
      const shown = names.filter((_, place) => place % each === 0);
      layout.annotations = shown.map((name) => ({ ...name, textangle: -90 }));
      layout.margin = { ...layout.margin, t: long + LINE };
      layout.height += long;
    }
    for (const trace of traces) {
      if (trace.texttemplate && room < CELL * trace.x.length + BARRED) delete trace.texttemplate;
      if (hidden.has(panel.figure + " " + trace.legendgroup)) trace.visible = false;
    }
    return [traces, layout];
  };
  const draw = (panel, width) => Plotly.react(document.getElementById(panel.id), ...painted(panel, width), config);

  const range = (plot) => [...plot._fullLayout.xaxis.range];
  const follow = (panel, change) => {
    if (syncing || !panel.sync) return;
    const moved = Object.keys(change).filter((key) => key.startsWith("xaxis."));
    if (!moved.length) return;
    const update = Object.fromEntries(moved.map((key) => [key, change[key]]));
    syncing = true;
    const others = page.panels.filter((other) => other.sync === panel.sync && other.id !== panel.id && drawn.has(other.id));
    Promise.all(others.map((other) => Plotly.relayout(other.id, update))).finally(() => { syncing = false; });
  };
  const keys = (panel) => (event) => {
    const plot = event.currentTarget;
    const [low, high] = range(plot);
    const span = high - low;
    const moves = {
      ArrowLeft: [low - span / 5, high - span / 5], ArrowRight: [low + span / 5, high + span / 5],
      "+": [low + span / 6, high - span / 6], "-": [low - span / 4, high + span / 4], 0: drawn.get(panel.id),
    };
    const next = moves[event.key];
    if (!next || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    Plotly.relayout(plot, { "xaxis.range[0]": next[0], "xaxis.range[1]": next[1] });
  };
  const start = async (panel) => {
    const plot = document.getElementById(panel.id);
    await draw(panel);
    drawn.set(panel.id, range(plot));
    plot.on("plotly_relayout", (change) => follow(panel, change));
    plot.on("plotly_click", ({ points }) => {
      const place = points[0].customdata; // a log's report
      if (typeof place === "string" && place.startsWith("./")) location.href = place;
    });
    plot.addEventListener("keydown", keys(panel));
  };
  const folded = (panel) => document.getElementById(panel.id).closest("details:not([open])");
  const redraw = (size) => {
    for (const panel of page.panels) if (drawn.has(panel.id)) draw(panel, size && size[panel.columns]);
  };

  for (const button of document.querySelectorAll(".legend button")) {
    button.addEventListener("click", () => {
      const { figure, group } = button.dataset;
      const show = button.getAttribute("aria-pressed") === "false";
      button.setAttribute("aria-pressed", String(show));
      hidden[show ? "delete" : "add"](figure + " " + group);
      for (const panel of page.panels) if (panel.figure === figure && drawn.has(panel.id)) draw(panel);
    });
  }
  for (const select of document.querySelectorAll(".views select")) {
    select.addEventListener("change", () => {
      const [low, high] = select.value.split(",").map(Number);
      const first = page.panels.find((panel) => panel.figure === select.dataset.figure);
      const update = select.value ? { "xaxis.range[0]": low, "xaxis.range[1]": high } : { "xaxis.autorange": true };
      Plotly.relayout(first.id, update);
    });
  }
  // While the arm moves, a line in the panels of its time shows the moment.
  document.addEventListener("arm-time", ({ detail }) => {
    for (const panel of page.panels) {
      if (panel.sync !== "torque" || !drawn.has(panel.id)) continue;
      const plot = document.getElementById(panel.id);
      const { xaxis, _size } = plot._fullLayout;
      const cursor = plot.querySelector(".cursor") || plot.appendChild(document.createElement("div"));
      const left = xaxis._offset + xaxis.l2p(detail);
      cursor.className = "cursor";
      cursor.hidden = left < xaxis._offset || left > xaxis._offset + xaxis._length;
      Object.assign(cursor.style, { left: left + "px", top: _size.t + "px", height: _size.h + "px" });
    }
  });
  const unfold = () => {
    const target = location.hash && document.getElementById(location.hash.slice(1));
    const details = target && target.closest("details");
    if (details && !details.open) {
      details.open = true;
      details.scrollIntoView();
    }
  };
  addEventListener("hashchange", unfold);
  unfold();
  const menu = document.querySelector("nav details");
  if (menu && innerWidth < 640) menu.open = false; // a phone shows the numbers first
  dark.addEventListener("change", () => redraw());
  addEventListener("beforeprint", () => {
    for (const details of document.querySelectorAll("details.paper:not(.one)")) details.open = true;
    root.dataset.theme = "light";
    redraw(PRINTED);
  });
  addEventListener("afterprint", () => { delete root.dataset.theme; redraw(); });

  const library = document.getElementById("library");
  if (library) {
    const script = document.createElement("script");
    script.textContent = await unpacked(library);
    document.head.append(script);
  }
  let failed = 0;
  const drawAll = async () => {
    for (const panel of page.panels) {
      if (drawn.has(panel.id) || folded(panel)) continue;
      try {
        await start(panel);
      } catch (error) {
        failed += 1;
        document.getElementById(panel.id).textContent = "This panel could not be drawn: " + error.message;
      }
      await new Promise((next) => setTimeout(next)); // let the page answer between panels
    }
    root.dataset.failed = failed;
    root.dataset.drawn = drawn.size;
  };
  for (const details of document.querySelectorAll("details")) details.addEventListener("toggle", drawAll);
  await drawAll();
})();
