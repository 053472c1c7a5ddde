"use strict";
(() => {
  const DEGREES = -180 / Math.PI; // SVG turns clockwise

  for (const figure of document.querySelectorAll("figure.arm")) {
    const { t, theta1, theta2 } = JSON.parse(figure.querySelector("script").textContent);
    const [first, second] = [figure.querySelector(".link1"), figure.querySelector(".link2")];
    const [button, slider, shown] = ["[data-play]", "input", "output"].map((what) => figure.querySelector(what));
    const speed = figure.querySelector("select");
    const end = t[t.length - 1];
    let now = t[0];
    let before = null;

    const between = (values, place) => {
      const low = Math.min(Math.floor(place), values.length - 2);
      return values.length < 2 ? values[0] : values[low] + (place - low) * (values[low + 1] - values[low]);
    };
    const show = () => {
      const place = end > t[0] ? (now - t[0]) / (end - t[0]) * (t.length - 1) : 0;
      first.setAttribute("transform", `rotate(${DEGREES * between(theta1, place)})`);
      second.setAttribute("transform", `translate(${second.dataset.at} 0) rotate(${DEGREES * between(theta2, place)})`);
      slider.value = now;
      shown.textContent = now.toFixed(2) + " s";
      document.dispatchEvent(new CustomEvent("arm-time", { detail: now }));
    };
    const playing = () => button.getAttribute("aria-pressed") === "true";
    const frame = (stamp) => {
      if (!playing()) return;
      now += before === null ? 0 : (stamp - before) / 1000 * Number(speed.value);
      before = stamp;
      if (now > end) now = t[0];
      show();
      requestAnimationFrame(frame);
    };
    const play = (yes) => {
      button.setAttribute("aria-pressed", String(yes));
      button.textContent = yes ? "Pause" : "Play";
      before = null;
      if (yes) requestAnimationFrame(frame);
    };
    button.addEventListener("click", () => play(!playing()));
    slider.addEventListener("input", () => { now = Number(slider.value); show(); });
    addEventListener("beforeprint", () => play(false));
    show();
  }
})();
