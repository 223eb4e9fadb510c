"use strict";
(() => {
  const page = document.documentElement;
  const unpacked = (element) => {
    const bytes = Uint8Array.from(atob(element.textContent), (letter) => letter.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  };
  const shown = new Map(); // the plots, by the ids of their elements

  // What a method draws carries its name among its tags.
  const show = (method, visible) => {
    for (const plot of shown.values())
      for (const renderer of plot.renderers)
        if (renderer.tags.includes(method)) renderer.visible = visible;
  };
  const press = (button, pressed) => {
    button.setAttribute("aria-pressed", String(pressed));
    show(button.dataset.method, pressed);
  };

  const zoom = (range, factor) => {
    const logarithmic = range.tags.includes("log");
    const [there, back] = logarithmic ? [Math.log, Math.exp] : [(x) => x, (x) => x];
    const [low, high] = [there(range.start), there(range.end)];
    const middle = (low + high) / 2;
    const half = ((high - low) / 2) * factor;
    range.setv({ start: back(middle - half), end: back(middle + half) });
  };
  const ranges = (figure) => {
    const plots = [...figure.querySelectorAll(".plot")].map((element) => shown.get(element.id));
    const all = plots.flatMap((plot) => [plot.x_range, plot.y_range, ...Object.values(plot.extra_y_ranges)]);
    return new Set(all.filter((range) => range.type === "Range1d"));
  };

  // A finger on a plot scrolls the page, a mouse draws a rectangle to zoom.
  const leaveFingers = () => {
    if (!matchMedia("(pointer: coarse)").matches) return;
    for (const plot of shown.values())
      for (const tool of plot.toolbar.tools) if (tool.type === "BoxZoomTool") tool.active = false;
  };

  const connect = () => {
    const methods = [...document.querySelectorAll("button.method")];
    for (const button of methods)
      button.addEventListener("click", () => press(button, button.getAttribute("aria-pressed") !== "true"));
    document.querySelector("button.all")?.addEventListener("click", () => methods.forEach((button) => press(button, true)));
    for (const button of document.querySelectorAll("button[data-zoom]"))
      button.addEventListener("click", () => {
        for (const range of ranges(button.closest(".figure")))
          if (button.dataset.zoom === "reset") range.reset();
          else zoom(range, button.dataset.zoom === "in" ? 0.5 : 2);
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

  const draw = async () => {
    const held = [document.getElementById("bokeh"), ...document.querySelectorAll(".plots")];
    const [bokeh, ...documents] = await Promise.all(held.map(unpacked));
    document.head.append(Object.assign(document.createElement("script"), { textContent: bokeh }));
    for (const [docid, plots] of documents.map((text) => JSON.parse(text)).entries()) {
      const roots = plots.roots.map((root) => [root.id, root.attributes.name]); // Bokeh pairs ids with roots by position
      const items = [{ docid, roots: Object.fromEntries(roots), root_ids: roots.map(([id]) => id) }];
      await Bokeh.embed.embed_items({ [docid]: plots }, items);
    }
    for (const one of Bokeh.documents) for (const root of one.roots()) shown.set(root.name, root);
    connect();
    leaveFingers();
    page.dataset.ready = "";
  };
  page.classList.add("live-page");
  draw().catch((error) => {
    page.classList.remove("live-page"); // the static pictures stand in
    throw error;
  });
})();
