"use strict";
(async () => {
  const NARROW = 640, PRINTED = 690; // CSS pixels: of a phone, and of A4 less its margins
  const [LETTER, KEY, LINE] = [6.8, 54, 22]; // pixels of a legend: a letter, the rest of an entry, a line
  const FRAME = 24; // pixels of a figure around its panels, less those below the last
  const own = document.currentScript.nonce;
  const unpacked = (id) => {
    const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (letter) => letter.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  };
  const root = document.documentElement;
  const { arm, ...figures } = JSON.parse(await unpacked("figures"));
  const touch = matchMedia("(pointer: coarse)").matches;
  const config = {
    responsive: true, displaylogo: false, displayModeBar: touch ? false : "hover",
    modeBarButtons: [["zoom2d", "pan2d", "autoScale2d", "resetScale2d", "toImage"]], toImageButtonOptions: { format: "svg" },
  };
  const drawn = new Map(); // the axes' first ranges by figure

  // Where there is no room for two columns of panels they stand one below the other.
  const stacked = (layout, room) => {
    const { rows, columns } = layout.grid;
    if (columns < 2 || room > NARROW) return layout;
    const panels = Object.keys(layout).filter((key) => key.startsWith("yaxis")).length;
    const height = (layout.height - FRAME) / rows * panels + FRAME;
    return { ...layout, height, grid: { ...layout.grid, rows: panels, columns: 1 } };
  };
  const themed = ({ data, layout }, room) => {
    const style = getComputedStyle(root);
    const [ink, muted, grid, page] = ["--ink", "--muted", "--line", "--page"].map((name) => style.getPropertyValue(name));
    const axis = { gridcolor: grid, zerolinecolor: grid, automargin: true, exponentformat: "power", title: { standoff: 6 } };
    const entries = data.filter((trace) => trace.showlegend);
    const lines = entries.length < 2 ? 0 : Math.ceil(entries.reduce((sum, { name }) => sum + KEY + LETTER * name.length, 0) / room);
    const look = {
      font: { color: ink, size: 12, family: "system-ui, sans-serif" }, xaxis: axis, yaxis: axis, paper_bgcolor: page, plot_bgcolor: page,
      margin: { l: 56, r: 12, t: 28 + LINE * lines, b: 51 }, showlegend: lines > 0, modebar: { bgcolor: page, color: muted, orientation: "v" },
      hoverlabel: { bgcolor: page, bordercolor: grid, font: { color: ink } }, hovermode: "closest",
      legend: { orientation: "h", x: 0, y: 1, yref: "container", yanchor: "top" },
    };
    const shown = stacked(layout, room);
    return {
      ...shown, height: shown.height + LINE * lines, template: { layout: look, data: { heatmap: [{ textfont: { color: ink } }] } }, uirevision: "kept",
      dragmode: touch ? false : "zoom", annotations: layout.annotations.map((one) => ({ ...one, bgcolor: page })),
    };
  };
  const axes = (plot) => Object.keys(plot._fullLayout).filter((key) => /^xaxis\d*$/.test(key) && !plot._fullLayout[key].matches);
  const draw = (key, width) => {
    const plot = document.getElementById("plot-" + key);
    const layout = themed(figures[key], width || plot.clientWidth);
    return Plotly.react(plot, figures[key].data, width ? { ...layout, width, autosize: false } : layout, config);
  };
  const keyed = (event) => {
    const plot = event.currentTarget;
    const shift = { ArrowLeft: [-0.2, -0.2], ArrowRight: [0.2, 0.2], "+": [0.17, -0.17], "-": [-0.25, 0.25], 0: [0, 0] }[event.key];
    if (!shift || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const change = {};
    for (const name of axes(plot)) {
      const first = drawn.get(plot.id)[name];
      const axis = plot._fullLayout[name];
      const [low, high] = event.key === "0" ? first : axis.range.map(axis.r2l);
      change[name + ".range"] = [low + shift[0] * (high - low), high + shift[1] * (high - low)].map(axis.l2r);
    }
    Plotly.relayout(plot, change);
  };
  const start = async (key) => {
    const plot = document.getElementById("plot-" + key);
    drawn.set(plot.id, {});
    await draw(key);
    drawn.set(plot.id, Object.fromEntries(axes(plot).map((name) => [name, plot._fullLayout[name].range.map(plot._fullLayout[name].r2l)])));
    plot.addEventListener("keydown", keyed);
  };
  let failed = 0;
  const drawAll = async () => {
    for (const key of Object.keys(figures)) {
      const plot = document.getElementById("plot-" + key);
      if (drawn.has(plot.id) || plot.closest("details:not([open])")) continue;
      try {
        await start(key);
      } catch (error) {
        failed += 1;
        plot.textContent = "This figure could not be drawn: " + error.message;
      }
      await new Promise((next) => setTimeout(next)); // let the page answer between figures
    }
    root.dataset.failed = failed;
    root.dataset.drawn = drawn.size;
  };
  const redraw = (width) => Promise.all([...drawn.keys()].map((id) => draw(id.slice("plot-".length), width)));

  const parts = [...document.querySelectorAll("details.part")];
  if (innerWidth < NARROW) { // a phone shows the numbers and the torque first
    for (const part of [document.querySelector("nav details"), ...parts.slice(1)]) part.open = false;
  }
  const unfold = () => {
    const target = location.hash && document.getElementById(location.hash.slice(1));
    if (target && target.matches("details:not([open])")) target.open = true;
  };
  addEventListener("hashchange", unfold);
  unfold();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => redraw());
  addEventListener("beforeprint", () => {
    for (const part of parts) part.open = true;
    root.dataset.theme = "light";
    for (const key of Object.keys(figures)) drawn.set("plot-" + key, drawn.get("plot-" + key) || {});
    redraw(PRINTED);
  });
  addEventListener("afterprint", () => { delete root.dataset.theme; redraw(); });

  const figure = document.getElementById("arm");
  if (figure) {
    const [first, second, button, slider, shown] = [".link1", ".link2", "button", "input", "output"].map((what) => figure.querySelector(what));
    const { t, theta1, theta2 } = arm;
    const span = t.at(-1) - t[0] || 1;
    const [l1, l2] = [Number(second.dataset.at), Number(second.querySelector("line").getAttribute("x2"))];
    const tip = theta1.map((one, at) => [one, one + theta2[at]]).map(([one, both]) =>
      `${(l1 * Math.cos(one) + l2 * Math.cos(both)).toFixed(4)},${(-l1 * Math.sin(one) - l2 * Math.sin(both)).toFixed(4)}`);
    figure.querySelector(".path").setAttribute("points", tip.join(" "));
    let before = null;
    const show = () => {
      const at = Math.round(slider.value * (t.length - 1));
      const [one, two] = [theta1[at], theta2[at]].map((angle) => -angle * 180 / Math.PI); // SVG turns clockwise
      first.setAttribute("transform", `rotate(${one})`);
      second.setAttribute("transform", `translate(${second.dataset.at} 0) rotate(${two})`);
      shown.textContent = t[at].toFixed(2) + " s";
    };
    const step = (now) => {
      if (before === null) return;
      slider.value = (Number(slider.value) + (now - before) / 1000 / span) % 1;
      before = now;
      show();
      requestAnimationFrame(step);
    };
    const play = (yes) => {
      before = yes ? performance.now() : null;
      button.setAttribute("aria-pressed", String(yes));
      button.textContent = yes ? "Pause" : "Play";
      if (yes) requestAnimationFrame(step);
    };
    button.addEventListener("click", () => play(before === null));
    slider.addEventListener("input", show);
    addEventListener("beforeprint", () => play(false));
    show();
  }

  if (document.getElementById("library")) {
    const script = document.createElement("script");
    script.nonce = own;
    script.textContent = await unpacked("library");
    document.head.append(script);
  }
  for (const part of parts) part.addEventListener("toggle", drawAll);
  await drawAll();
})();
