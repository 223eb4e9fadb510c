"use strict";
// Figure 6 in motion: substeps of a method in phase space, in plain doubles, and the energy error beside them.
(() => {
  const section = document.getElementById("alive");
  const methods = Object.fromEntries(JSON.parse(document.getElementById("methods").textContent).map((one) => [one.name, one]));
  const square = (x) => x * x;
  // State: positions q and momenta p; the drawn coordinate is the last one. Units of the paper.
  const systems = {
    sho: {
      start: [1, 0], window: [-1.4, 1.4, -1.4, 1.4], tau: 0.785,
      V: ([x]) => square(x) / 2,
      force: ([x]) => [-x],
    },
    henon_heiles: {
      start: [0.4, 0.4], window: [-0.6, 1.05, -0.8, 0.8], tau: 2,
      V: ([x, y]) => (square(x) + square(y)) / 2 + y * (square(x) - square(y) / 3),
      force: ([x, y]) => [-(x + 2 * x * y), -(y + square(x) - square(y))],
    },
  };
  const energy = (system, q, p) => p.reduce((sum, one) => sum + square(one) / 2, systems[system].V(q));

  // One step: positions and momenta after each substep, kicks and drifts in the order of the method.
  const step = (system, method, tau, q, p) => {
    const { first, kick, drift } = methods[method];
    const passed = [];
    const move = (kicks, coefficient) => {
      if (kicks) {
        const force = systems[system].force(q);
        p = p.map((one, i) => one + coefficient * tau * force[i]);
      } else q = q.map((one, i) => one + coefficient * tau * p[i]);
      passed.push({ q, p, kicks, negative: coefficient < 0 });
    };
    const [outer, inner] = first === "kick" ? [kick, drift] : [drift, kick];
    for (let i = 0; i < outer.length; i += 1) {
      move(first === "kick", outer[i]);
      if (i < inner.length) move(first !== "kick", inner[i]);
    }
    return passed;
  };
  // State and largest energy error of a run, for comparisons.
  const run = (system, method, tau, q, p, steps) => {
    const H0 = energy(system, q, p);
    let worst = 0;
    for (let i = 0; i < steps; i += 1) {
      ({ q, p } = step(system, method, tau, q, p).at(-1));
      worst = Math.max(worst, Math.abs(energy(system, q, p) / H0 - 1));
    }
    return { q, p, worst };
  };
  globalThis.alive = { run };

  const control = (name) => section.querySelector(`[name=${name}]`);
  const [plane, plot] = section.querySelectorAll("canvas");
  const state = { q: [], p: [], H0: 0, path: [], errors: [], left: 0, timer: 0 };
  const chosen = () => ({ system: control("system").value, method: control("method").value, tau: Number(control("tau").value) });
  const box = (canvas) => {
    const size = canvas.getBoundingClientRect(), ratio = devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(size.width * ratio));
    canvas.height = Math.max(1, Math.round(size.height * ratio));
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    return { pen, width: size.width, height: size.height };
  };
  const margin = 44;
  const axes = ({ pen, width, height }, [x0, x1, y0, y1], [x, y]) => {
    pen.fillStyle = "#ffffff";
    pen.fillRect(0, 0, width, height);
    const across = (value) => margin + ((value - x0) / (x1 - x0)) * (width - margin - 8);
    const up = (value) => height - margin + ((value - y0) / (y1 - y0)) * (8 + margin - height);
    pen.font = "13px system-ui, sans-serif";
    pen.fillStyle = "#222222";
    pen.textAlign = "center";
    pen.fillText(x, (margin + width) / 2, height - 8);
    pen.save();
    pen.translate(13, (height - margin) / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText(y, 0, 0);
    pen.restore();
    pen.strokeStyle = "#444444";
    pen.strokeRect(margin, 8, width - margin - 8, height - margin - 8);
    return { across, up };
  };
  const tick = (pen, places, height, across, up, ends) => {
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    for (const value of places.x) pen.fillText(value, across(value), height - margin + 15);
    pen.textAlign = "right";
    for (const value of places.y) pen.fillText(ends(value), margin - 4, up(value) + 4);
  };

  const drawPlane = () => {
    const { system } = chosen();
    const frame = box(plane), range = systems[system].window;
    const { across, up } = axes(frame, range, ["position q", "momentum p"]);
    const { pen } = frame;
    const other = state.q.slice(0, -1), still = state.p.slice(0, -1);
    const at = (x, y) => energy(system, [...other.map(() => 0), x], [...still.map(() => 0), y]);
    // Contours of H, and the energy surface of the start.
    const grid = 90, levels = Array.from({ length: 14 }, (_, i) => ((i + 1) * at(range[1], range[3])) / 14);
    const cell = (i, j) => at(range[0] + ((range[1] - range[0]) * i) / grid, range[2] + ((range[3] - range[2]) * j) / grid);
    const values = Array.from({ length: grid + 1 }, (_, i) => Array.from({ length: grid + 1 }, (_, j) => cell(i, j)));
    const contour = (level, colour, line) => {
      pen.strokeStyle = colour;
      pen.lineWidth = line;
      pen.beginPath();
      for (let i = 0; i < grid; i += 1)
        for (let j = 0; j < grid; j += 1) {
          const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]], ends = [];
          corners.forEach(([a, b], k) => {
            const [c, d] = corners[(k + 1) % 4], one = values[a][b], two = values[c][d];
            if (one < level !== two < level) {
              const share = (level - one) / (two - one);
              const x = range[0] + ((range[1] - range[0]) * (a + share * (c - a))) / grid;
              const y = range[2] + ((range[3] - range[2]) * (b + share * (d - b))) / grid;
              ends.push([across(x), up(y)]);
            }
          });
          for (let k = 0; k + 1 < ends.length; k += 2) {
            pen.moveTo(...ends[k]);
            pen.lineTo(...ends[k + 1]);
          }
        }
      pen.stroke();
    };
    for (const level of levels) contour(level, "#d4d9e0", 1);
    contour(state.H0, "#1f2d3d", 1.6);
    tick(pen, { x: [-1, -0.5, 0, 0.5, 1].filter((v) => v > range[0] && v < range[1]), y: [-0.5, 0, 0.5] }, frame.height, across, up, String);
    pen.save();
    pen.beginPath();
    pen.rect(margin, 8, frame.width - margin - 8, frame.height - margin - 8);
    pen.clip();
    const place = ({ q, p }) => [across(q.at(-1)), up(p.at(-1))];
    pen.strokeStyle = "#4d5661";
    pen.lineWidth = 1;
    pen.beginPath();
    state.path.forEach((one, i) => (i ? pen.lineTo(...place(one)) : pen.moveTo(...place(one))));
    pen.stroke();
    for (const one of state.path) {
      pen.fillStyle = one.negative ? "#d7301f" : "#0b5fb5";
      pen.beginPath();
      pen.arc(...place(one), one.whole ? 4 : 2, 0, 7);
      pen.fill();
    }
    pen.restore();
  };
  const drawErrors = () => {
    const frame = box(plot), steps = Math.max(50, state.errors.length);
    const { across, up } = axes(frame, [0, steps, -16, 1], ["iteration", "|ΔH/H₀|"]);
    const { pen } = frame;
    const power = (value) => `1e${value}`;
    tick(pen, { x: [0, Math.round(steps / 2), steps], y: [-15, -12, -9, -6, -3, 0] }, frame.height, across, up, power);
    pen.strokeStyle = "#0b5fb5";
    pen.lineWidth = 1.2;
    pen.beginPath();
    state.errors.forEach((error, i) => {
      const y = up(Math.min(1, Math.max(-16, Math.log10(error))));
      if (i) pen.lineTo(across(i + 1), y);
      else pen.moveTo(across(1), y);
    });
    pen.stroke();
  };
  const draw = () => {
    drawPlane();
    drawErrors();
    const last = state.errors.at(-1);
    const told = state.left ? `left its energy surface at iteration ${state.left}` : last === undefined ? "click into the plane to start there" : `|ΔH/H₀| = ${last.toExponential(2)} after ${state.errors.length} iterations`;
    section.querySelector("output").textContent = told;
  };
  const reset = () => {
    const { system } = chosen();
    state.path = [{ q: state.q, p: state.p, whole: true }];
    state.errors = [];
    state.left = 0;
    state.H0 = energy(system, state.q, state.p);
    draw();
  };
  const begin = ([x, y]) => {
    const [d, aside] = [chosen().system === "sho" ? 1 : 2, Number(control("aside").value)];
    state.q = d === 1 ? [x] : [aside, x];
    state.p = d === 1 ? [y] : [0, y];
    state.at = [x, y];
    reset();
  };
  const advance = () => {
    const { system, method, tau } = chosen();
    if (state.left) return;
    const passed = step(system, method, tau, state.q, state.p);
    passed.at(-1).whole = true;
    ({ q: state.q, p: state.p } = passed.at(-1));
    state.path = [...state.path, ...passed].slice(-60);
    const error = Math.abs(energy(system, state.q, state.p) / state.H0 - 1);
    state.errors.push(error);
    if (!(error < 1)) state.left = state.errors.length;
    draw();
  };
  const pause = () => {
    clearInterval(state.timer);
    state.timer = 0;
    control("run").textContent = "Run";
  };
  const toggle = () => {
    if (state.timer) return pause();
    control("run").textContent = "Pause";
    state.timer = setInterval(() => (state.left ? pause() : advance()), 120);
  };

  control("system").addEventListener("change", () => {
    const { start, tau } = systems[chosen().system];
    control("tau").value = tau;
    pause();
    begin(start);
  });
  for (const name of ["method", "tau", "aside"])
    control(name).addEventListener("input", () => {
      section.querySelector(".tau").textContent = control("tau").value;
      begin(state.at);
    });
  control("step").addEventListener("click", advance);
  control("run").addEventListener("click", toggle);
  control("reset").addEventListener("click", () => begin(state.at));
  plane.addEventListener("pointerdown", (event) => {
    const size = plane.getBoundingClientRect(), [x0, x1, y0, y1] = systems[chosen().system].window;
    const share = (event.clientX - size.left - margin) / (size.width - margin - 8);
    const high = (size.height - margin - (event.clientY - size.top)) / (size.height - margin - 8);
    begin([x0 + share * (x1 - x0), y0 + high * (y1 - y0)]);
  });
  addEventListener("resize", draw);
  section.classList.add("ready");
  begin(systems[chosen().system].start);
})();
