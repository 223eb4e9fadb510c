"use strict";
(() => {
  const page = document.documentElement;
  const unpacked = (element) => {
    const bytes = Uint8Array.from(atob(element.textContent), (letter) => letter.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  };
  const shown = new Map(); // the plots, by the ids of their elements

  const plotsOf = (figure) => [...figure.querySelectorAll(".plot")].map((one) => shown.get(one.id)).filter(Boolean);

  // Legends: a pressed button shows its method, and without a pressed one all are shown. What a method draws carries its
  // name among its tags.
  const legends = [...document.querySelectorAll(".legend")];
  const isPressed = (button) => button.getAttribute("aria-pressed") === "true";
  const press = (button, pressed) => button.setAttribute("aria-pressed", String(pressed));
  const methodsOf = (legend) => [...legend.querySelectorAll("button.method")];

  const alphas = new Map(); // of glyphs, as they were drawn
  const fade = ({ glyph }, faded) => {
    if (!alphas.has(glyph)) {
      const { line_alpha, fill_alpha, text_alpha } = glyph;
      alphas.set(glyph, Object.entries({ line_alpha, fill_alpha, text_alpha }).filter(([, alpha]) => alpha !== undefined));
    }
    // Columns have the opacity of single points; 0 is invisible, for the hover.
    const pale = (alpha) => (alpha.field !== undefined ? 0 : Math.min(0.12, alpha.value ?? alpha));
    glyph.setv(Object.fromEntries(alphas.get(glyph).map(([name, alpha]) => [name, faded ? pale(alpha) : alpha])));
  };

  const show = (legend, pointed = null) => {
    const buttons = methodsOf(legend);
    const pressed = buttons.filter(isPressed);
    const visible = new Set((pressed.length ? pressed : buttons).map((button) => button.dataset.method));
    press(legend.querySelector("button.all"), !pressed.length);
    legend.classList.toggle("chosen", pressed.length > 0);
    for (const plot of plotsOf(legend.closest(".figure")))
      for (const renderer of plot.renderers) {
        const [method] = renderer.tags;
        if (method === undefined) continue;
        renderer.visible = visible.has(method);
        if (pointed || alphas.has(renderer.glyph)) fade(renderer, visible.has(pointed) && method !== pointed);
      }
  };

  for (const legend of legends) {
    legend.querySelector("button.all").addEventListener("click", () => {
      for (const button of methodsOf(legend)) press(button, false);
      show(legend);
    });
    for (const button of methodsOf(legend)) {
      const { method } = button.dataset;
      button.addEventListener("click", () => {
        press(button, !isPressed(button));
        if (methodsOf(legend).every(isPressed)) for (const one of methodsOf(legend)) press(one, false);
        show(legend);
      });
      button.addEventListener("pointerenter", (event) => event.pointerType === "mouse" && show(legend, method));
      button.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && show(legend));
      button.addEventListener("focus", () => button.matches(":focus-visible") && show(legend, method));
      button.addEventListener("blur", () => show(legend));
    }
  }

  const zoom = (range, factor) => {
    const logarithmic = range.tags.includes("log");
    const [there, back] = logarithmic ? [Math.log, Math.exp] : [(x) => x, (x) => x];
    const [low, high] = [there(range.start), there(range.end)];
    const middle = (low + high) / 2;
    const half = ((high - low) / 2) * factor;
    range.setv({ start: back(middle - half), end: back(middle + half) });
  };
  const ranges = (figure) => {
    const axes = (plot) => [plot.x_range, plot.y_range, ...Object.values(plot.extra_y_ranges)];
    const all = plotsOf(figure).flatMap(axes);
    return new Set(all.filter((range) => range.type === "Range1d"));
  };
  for (const button of document.querySelectorAll("button[data-zoom]"))
    button.addEventListener("click", () => {
      for (const range of ranges(button.closest(".figure")))
        if (button.dataset.zoom === "reset") range.reset();
        else zoom(range, button.dataset.zoom === "in" ? 0.5 : 2);
    });

  // A finger on a plot scrolls the page, and a tap shows what a hover shows until the next tap or scroll; a mouse draws
  // a rectangle to zoom.
  let forget = () => {};
  addEventListener("scroll", () => forget());
  const leaveFingers = (plot) => {
    if (!matchMedia("(pointer: coarse)").matches) return;
    for (const tool of plot.toolbar.tools) if (tool.type === "BoxZoomTool") tool.active = false;
    document.getElementById(plot.name).addEventListener("click", (event) => {
      const { clientX, clientY } = event, [place] = event.composedPath();
      const tell = (name) => place.dispatchEvent(new PointerEvent(name, { clientX, clientY, isPrimary: true, view: window }));
      forget();
      forget = () => tell("pointerout");
      tell("pointermove");
    });
  };

  const filters = [...document.querySelectorAll("button[data-only]")];
  const only = (look) => {
    for (const button of filters) button.setAttribute("aria-pressed", String(button.dataset.only === look));
    for (const row of document.querySelectorAll("tr[data-look]")) row.hidden = look !== "" && row.dataset.look !== look;
  };
  for (const button of filters) button.addEventListener("click", () => only(button.dataset.only));

  // A link to something folded unfolds it, a link to a statement shows all of them.
  const unfold = () => {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target) return;
    if (target.hidden) only("");
    let folded = target.closest("details");
    if (!folded) return;
    for (; folded; folded = folded.parentElement.closest("details")) folded.open = true;
    target.scrollIntoView();
  };
  addEventListener("hashchange", unfold);
  unfold();

  for (const button of document.querySelectorAll("button.copy"))
    button.addEventListener("click", async () => {
      const link = `${location.href.split("#")[0]}#${button.dataset.anchor}`;
      location.hash = button.dataset.anchor;
      try {
        await navigator.clipboard.writeText(link);
        button.textContent = "Copied";
      } catch {
        button.textContent = "Copy it from the address bar";
      }
    });

  // The plots of a figure take the place of its static picture when they are drawn.
  const draw = async () => {
    const held = [document.getElementById("bokeh"), ...document.querySelectorAll(".plots")];
    const [bokeh, ...documents] = await Promise.all(held.map(unpacked));
    document.head.append(Object.assign(document.createElement("script"), { textContent: bokeh }));
    for (const [docid, plots] of documents.map((text) => JSON.parse(text)).entries()) {
      const roots = plots.roots.map((root) => [root.id, root.attributes.name]); // Bokeh pairs ids with roots by position
      const elements = roots.map(([, name]) => document.getElementById(name));
      for (const [i, root] of plots.roots.entries()) root.attributes.height = elements[i].clientHeight;
      const items = [{ docid, roots: Object.fromEntries(roots), root_ids: roots.map(([id]) => id) }];
      await Bokeh.embed.embed_items({ [docid]: plots }, items);
      const drawn = Bokeh.documents.flatMap((one) => one.roots()).filter((root) => !shown.has(root.name));
      for (const root of drawn) shown.set(root.name, root);
      drawn.forEach(leaveFingers);
      const figure = elements[0].closest(".figure");
      show(figure.querySelector(".legend"));
      figure.classList.add("ready");
      await new Promise((done) => setTimeout(done)); // the browser paints it and answers before the next one
    }
    page.dataset.ready = "";
  };
  draw().catch((error) => {
    page.classList.remove("live-page"); // the static pictures stay
    throw error;
  });
})();
