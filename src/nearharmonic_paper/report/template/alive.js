"use strict";
// Figure 6 in motion: substeps of two methods in phase space, in plain doubles, and their energy errors.
(() => {
  const section = document.getElementById("alive");
  const methods = Object.fromEntries(JSON.parse(document.getElementById("methods").textContent).map((one) => [one.name, one]));
  const square = (x) => x * x;
  // State: positions q and momenta p; the drawn coordinate is the last one. Starts and steps are the paper's.
  const systems = {
    sho: {
      start: [0, 1], window: [-1.4, 1.4, -1.4, 1.4], tau: 0.785, ticks: [-1, 0, 1], axis: "",
      V: ([x]) => square(x) / 2,
      force: ([x]) => [-x],
    },
    henon_heiles: {
      start: [0.4, 0.4], window: [-0.65, 1.05, -0.85, 0.85], tau: 2, ticks: [-0.5, 0, 0.5, 1], axis: "y",
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

  // --- The two runs: all iterations so far, and the substeps of the last ones.
  const LAST = 300; // iterations
  const SLOW = 3; // iterations drawn substep by substep
  const FRAMES = 16; // pictures of such an iteration
  const PAUSE = 70; // milliseconds between two pictures
  const control = (name) => section.querySelector(`[name=${name}]`);
  const chosen = () => ({ system: control("system").value, tau: Number(control("tau").value) });
  const errorPlot = section.querySelector(".errors canvas");
  const runs = [...section.querySelectorAll(".plane")].map((panel, i) => ({
    canvas: panel.querySelector("canvas"), says: panel.querySelector(".note"), title: panel.querySelector(".title"),
    choice: control(["left", "right"][i]), ground: document.createElement("canvas"),
  }));
  const told = (text) => { section.querySelector(".value").textContent = text; };
  const method = (one) => methods[one.choice.value];
  const state = { start: [0, 0], phase: 0, picked: null };

  const begin = (start) => {
    const { system } = chosen(), flat = system === "sho", aside = flat ? 0 : Number(control("aside").value);
    const [q, p] = flat ? [[start[0]], [start[1]]] : [[aside, start[0]], [0, start[1]]];
    Object.assign(state, { start, phase: 0, picked: null });
    [control("q").value, control("p").value] = start.map((value) => Number(value.toFixed(4)));
    section.querySelector(".tau").textContent = control("tau").value;
    for (const one of runs) {
      Object.assign(one, { q, p, H0: energy(system, q, p), states: [{ q, p }], path: [{ q, p, whole: true, n: 0 }], errors: [], left: 0 });
      one.title.querySelector("b").style.color = method(one).colour;
      one.title.querySelector("span").textContent = method(one).label;
      paintGround(one);
    }
    told("Point at a dot, or tap it, for its numbers.");
    draw();
  };
  const advance = (one) => {
    if (one.left) return;
    const { system, tau } = chosen();
    const passed = step(system, one.choice.value, tau, one.q, one.p), n = one.errors.length + 1;
    passed.forEach((each, i) => Object.assign(each, { n, at: i + 1 }));
    passed.at(-1).whole = true;
    ({ q: one.q, p: one.p } = passed.at(-1));
    one.path = [...one.path.filter((each) => each.n >= n - 1), ...passed];
    one.states.push({ q: one.q, p: one.p, n });
    one.errors.push(Math.abs(energy(system, one.q, one.p) / one.H0 - 1));
    if (!(one.errors.at(-1) < 1)) one.left = n;
  };
  const done = () => runs.every((one) => one.left || one.errors.length >= LAST);
  const iterate = () => {
    runs.forEach(advance);
    state.phase = FRAMES;
  };
  // The next picture: some substeps further in the first iterations, an iteration further later.
  const next = () => {
    if (state.phase > 0 && state.phase < FRAMES) state.phase += 1;
    else {
      iterate();
      if (Math.max(...runs.map((one) => one.errors.length)) <= SLOW) state.phase = 1;
    }
    draw();
  };

  // --- Drawing on white: dark mode inverts the panel.
  const sized = (canvas, like = canvas) => {
    const size = like.getBoundingClientRect(), ratio = devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(size.width * ratio));
    canvas.height = Math.max(1, Math.round(size.height * ratio));
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.fillStyle = "#ffffff";
    pen.fillRect(0, 0, size.width, size.height);
    return { pen, width: size.width, height: size.height };
  };
  const font = (size) => `${size}px system-ui, sans-serif`;
  // Frame of a plot: places on the canvas of x and y, and the other way round.
  const framed = ({ width, height }, [x0, x1, y0, y1]) => {
    const left = width < 280 ? 30 : 46, below = 34, [across, high] = [width - left - 8, height - below - 8];
    return {
      left, across, high, bottom: height - below,
      x: (value) => left + ((value - x0) / (x1 - x0)) * across,
      y: (value) => height - below - ((value - y0) / (y1 - y0)) * high,
      at: (x, y) => [x0 + ((x - left) / across) * (x1 - x0), y0 + ((height - below - y) / high) * (y1 - y0)],
    };
  };
  const axes = (pen, frame, [x, y], [along, up], power) => {
    pen.strokeStyle = "#444444";
    pen.lineWidth = 1;
    pen.strokeRect(frame.left, 8, frame.across, frame.high);
    pen.fillStyle = "#222222";
    pen.font = font(11);
    pen.textAlign = "center";
    for (const value of along) pen.fillText(value, frame.x(value), frame.bottom + 14);
    pen.textAlign = "right";
    for (const value of up) pen.fillText(power ? `10${raised(value)}` : value, frame.left - 4, frame.y(value) + 4);
    pen.textAlign = "center";
    pen.font = font(13);
    const write = ([letter, below], atX, atY) => {
      pen.fillText(letter, atX, atY);
      if (!below) return;
      pen.font = font(10);
      pen.fillText(below, atX + 7, atY + 3);
      pen.font = font(13);
    };
    write(x, frame.left + frame.across / 2, frame.bottom + 28);
    if (y) write(y, frame.left / 3 + 2, 18);
  };
  const raised = (n) => [...String(n)].map((digit) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(digit)]).join("");
  const short = (value, digits = 1) => {
    if (value === 0) return "0";
    const [mantissa, power] = value.toExponential(digits).split("e");
    return `${mantissa} × 10${raised(Number(power))}`;
  };

  // Contours of H, drawn once for all pictures, and the energy surface of the start.
  const paintGround = (one) => {
    const { system } = chosen(), { window: range, ticks, axis } = systems[system];
    const size = sized(one.ground, one.canvas), { pen } = size, frame = framed(size, range);
    const at = (x, y) => energy(system, system === "sho" ? [x] : [0, x], system === "sho" ? [y] : [0, y]);
    const grid = 80, highest = at(range[1], range[3]);
    const value = (i, j) => at(range[0] + ((range[1] - range[0]) * i) / grid, range[2] + ((range[3] - range[2]) * j) / grid);
    const values = Array.from({ length: grid + 1 }, (_, i) => Array.from({ length: grid + 1 }, (_, j) => value(i, j)));
    const place = (i, j) => [frame.left + (i / grid) * frame.across, frame.bottom - (j / grid) * frame.high];
    const contour = (level, colour, width) => {
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.beginPath();
      for (let i = 0; i < grid; i += 1)
        for (let j = 0; j < grid; j += 1) {
          const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]], ends = [];
          corners.forEach(([a, b], k) => {
            const [c, d] = corners[(k + 1) % 4], [here, there] = [values[a][b], values[c][d]];
            if (here < level === there < level) return;
            const share = (level - here) / (there - here);
            ends.push(place(a + share * (c - a), b + share * (d - b)));
          });
          for (let k = 0; k + 1 < ends.length; k += 2) {
            pen.moveTo(...ends[k]);
            pen.lineTo(...ends[k + 1]);
          }
        }
      pen.stroke();
    };
    for (let i = 1; i <= 14; i += 1) contour((i * highest) / 14, "#d4d9e0", 1);
    contour(one.H0, "#1f2d3d", 1.6);
    axes(pen, frame, [["q", axis], ["p", axis]], [ticks, ticks.filter((tick) => tick < range[3])]);
  };
  const dot = (pen, [x, y], radius, colour) => {
    pen.fillStyle = colour;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 7);
    pen.fill();
  };
  // The part of the path that this picture shows.
  const visible = (one) => {
    const n = one.errors.length, count = one.path.filter((each) => each.n === n).length;
    const kept = state.phase ? Math.ceil((count * state.phase) / FRAMES) : count;
    return one.path.slice(0, one.path.length - (one.left && one.left < n ? 0 : count - kept));
  };
  const placed = (one) => {
    const { system } = chosen(), frame = framed(one.canvas.getBoundingClientRect(), systems[system].window);
    return { frame, place: ({ q, p }) => [frame.x(q.at(-1)), frame.y(p.at(-1))] };
  };
  const drawPlane = (one) => {
    const { pen, width, height } = sized(one.canvas), { frame, place } = placed(one), small = width < 280;
    pen.drawImage(one.ground, 0, 0, width, height);
    pen.save();
    pen.beginPath();
    pen.rect(frame.left, 8, frame.across, frame.high);
    pen.clip();
    for (const each of one.states.slice(0, -1)) dot(pen, place(each), small ? 1.4 : 1.8, method(one).colour);
    const path = visible(one);
    pen.strokeStyle = "#4d5661";
    pen.lineWidth = 1;
    pen.beginPath();
    path.forEach((each, i) => (i ? pen.lineTo(...place(each)) : pen.moveTo(...place(each))));
    pen.stroke();
    for (const each of path) dot(pen, place(each), each.whole ? 4 : (small ? 2 : 2.6) + (each.negative ? 0.8 : 0), each.whole ? method(one).colour : each.negative ? "#d7301f" : "#4d5661");
    pen.strokeStyle = "#1f2d3d";
    pen.lineWidth = 1.6;
    pen.beginPath();
    pen.arc(...place(one.states[0]), 6, 0, 7);
    pen.stroke();
    if (state.picked?.of === one) {
      pen.strokeStyle = "#b35900";
      pen.lineWidth = 2.5;
      pen.beginPath();
      pen.arc(...place(state.picked), 9, 0, 7);
      pen.stroke();
    }
    pen.restore();
    const n = one.errors.length - (state.phase > 0 && state.phase < FRAMES && !one.left ? 1 : 0);
    if (one.left) one.says.textContent = `left its energy surface at iteration ${one.left}`;
    else one.says.textContent = n ? `|ΔH/H₀| = ${short(one.errors[n - 1])} after ${n} iteration${n > 1 ? "s" : ""}` : "start";
  };
  const range = () => {
    const smallest = Math.min(1e-5, ...runs.flatMap((one) => one.errors.filter((error) => error > 0)));
    return [0, Math.max(60, ...runs.map((one) => one.errors.length)), Math.max(-17, Math.floor(Math.log10(smallest)) - 1), 1];
  };
  const drawErrors = () => {
    const size = sized(errorPlot), { pen } = size, limits = range(), frame = framed(size, limits);
    axes(pen, frame, [["iteration", ""]], [[0, Math.round(limits[1] / 2), limits[1]], [-15, -12, -9, -6, -3, 0].filter((power) => power > limits[2])], true);
    for (const one of runs) {
      const places = one.errors.map((error, i) => [frame.x(i + 1), frame.y(Math.min(1, Math.max(limits[2], Math.log10(error))))]);
      pen.strokeStyle = method(one).colour;
      pen.lineWidth = 1.4;
      pen.beginPath();
      places.forEach((place, i) => (i ? pen.lineTo(...place) : pen.moveTo(...place)));
      pen.stroke();
      for (const place of places.length < 40 ? places : places.slice(-1)) dot(pen, place, 2.6, method(one).colour);
    }
  };
  const draw = () => {
    runs.forEach(drawPlane);
    drawErrors();
  };

  // --- Values: pointing or tapping shows the nearest dot, or H at the place itself.
  const pick = (one, event) => {
    const { system } = chosen(), size = one.canvas.getBoundingClientRect(), { frame, place } = placed(one);
    const [x, y] = [event.clientX - size.left, event.clientY - size.top];
    const known = [...visible(one), ...one.states].map((each) => ({ each, far: Math.hypot(place(each)[0] - x, place(each)[1] - y) }));
    const nearest = known.reduce((best, each) => (each.far < best.far ? each : best));
    const dotted = nearest.far < 18, [q, p] = dotted ? [nearest.each.q, nearest.each.p] : frame.at(x, y).map((value) => (system === "sho" ? [value] : [0, value]));
    const { n, at, kicks, negative } = nearest.each, H = energy(system, q, p);
    const substep = `iteration ${n}, after substep ${at}, a ${negative ? "backward" : "forward"} ${kicks ? "kick" : "drift"}`;
    const where = dotted ? (at ? substep : n ? `after iteration ${n}` : "start") : "here";
    state.picked = { of: one, q, p };
    told(`${method(one).label}, ${where}: q = ${q.at(-1).toFixed(4)}, p = ${p.at(-1).toFixed(4)}, H = ${H.toFixed(4)}, |ΔH/H₀| = ${short(Math.abs(H / one.H0 - 1))}`);
    draw();
    return [q.at(-1), p.at(-1)];
  };
  for (const one of runs) {
    one.canvas.addEventListener("click", (event) => pick(one, event));
    one.canvas.addEventListener("pointermove", (event) => event.pointerType === "mouse" && pick(one, event));
    one.canvas.addEventListener("dblclick", (event) => {
      const size = one.canvas.getBoundingClientRect();
      begin(placed(one).frame.at(event.clientX - size.left, event.clientY - size.top));
    });
    one.choice.addEventListener("input", () => again());
  }
  const pickError = (event) => {
    const size = errorPlot.getBoundingClientRect(), n = Math.max(1, Math.round(framed(size, range()).at(event.clientX - size.left, 0)[0]));
    const errors = runs.filter((one) => one.errors[n - 1] !== undefined).map((one) => `${method(one).label} ${short(one.errors[n - 1])}`);
    told(errors.length ? `|ΔH/H₀| after iteration ${n}: ${errors.join(", ")}` : "");
  };
  errorPlot.addEventListener("click", pickError);
  errorPlot.addEventListener("pointermove", (event) => event.pointerType === "mouse" && pickError(event));

  // --- Motion: by itself while it is seen, unless the reader has paused it or asks for less motion.
  let [timer, seen, held] = [0, false, matchMedia("(prefers-reduced-motion: reduce)").matches];
  const settle = () => {
    const moves = seen && !held && !done();
    if (moves && !timer) timer = setInterval(() => { next(); settle(); }, PAUSE);
    if (!moves) timer = clearInterval(timer);
    control("run").textContent = done() ? "Again" : held ? "Run" : "Pause";
  };
  // From the start; at rest with the two iterations of the figure.
  const again = () => {
    begin(state.start);
    if (held) [iterate(), iterate(), draw()];
    settle();
  };
  control("system").addEventListener("change", () => {
    const { start, tau } = systems[chosen().system];
    control("tau").value = tau;
    state.start = start;
    again();
  });
  for (const name of ["tau", "aside"]) control(name).addEventListener("input", again);
  for (const name of ["q", "p"])
    control(name).addEventListener("change", () => {
      state.start = [Number(control("q").value), Number(control("p").value)];
      again();
    });
  control("run").addEventListener("click", () => {
    if (done()) begin(state.start);
    else held = !held;
    settle();
  });
  control("step").addEventListener("click", () => {
    held = true;
    iterate();
    draw();
    settle();
  });
  control("reset").addEventListener("click", () => {
    begin(state.start);
    settle();
  });
  new IntersectionObserver((entries) => {
    seen = entries.at(-1).isIntersecting;
    settle();
  }, { threshold: 0.3 }).observe(section.querySelector(".panels"));
  new ResizeObserver(() => {
    runs.forEach(paintGround);
    draw();
  }).observe(section.querySelector(".panels"));
  state.start = systems[chosen().system].start;
  again();
})();
