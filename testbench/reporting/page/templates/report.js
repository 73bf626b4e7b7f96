(function () {
  "use strict";
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const narrow = window.matchMedia("(max-width: 40rem)");
  const holders = Array.from(document.querySelectorAll(".figure"));
  const ICONS = {
    png: "M4 4h16v16H4zM6 6v12h12V6zM7.5 17l3.5-5 2.5 3 2-2.5 2.5 4.5z",
    svg: "M4 4h16v16H4zM6 6v12h12V6zM8 16c2-9 6-9 8 0h-1.5c-1.5-6-3.5-6-5 0z"
  };

  // The figure as a file, on the paper of the page: what is see-through would be lost on another.
  function save(format) {
    return {
      name: "Save as " + format.toUpperCase(),
      icon: { width: 24, height: 24, path: ICONS[format] },
      click: (holder) => Plotly.downloadImage(
        { data: holder.data, layout: Object.assign({}, holder.layout, { paper_bgcolor: colours().paper }) },
        {
          format, scale: format === "png" ? 2 : 1, width: holder.clientWidth, height: holder.layout.height,
          filename: holder.getAttribute("aria-label").replace(/[^\p{L}\p{N}]+/gu, "_").slice(0, 80)
        }
      )
    };
  }

  // The buttons are listed one by one: plotly's own choice has one that uploads the figure.
  function config(figure, small) {
    const solid = figure.data.some((trace) => /3d$|^surface$/.test(trace.type));
    const ways = solid ? ["orbitRotation", "pan3d", "zoom3d", "resetCameraDefault3d"] : ["zoom2d", "pan2d", "resetScale2d"];
    return {
      responsive: true, displaylogo: false, showSendToCloud: false, plotlyServerURL: "", displayModeBar: narrow.matches ? false : "hover",
      modeBarButtons: [[save("png"), save("svg"), ...(small ? [] : ways)]]
    };
  }

  function colours() {
    const style = getComputedStyle(document.documentElement);
    const read = (name) => style.getPropertyValue(name).trim();
    const names = ["ink", "soft", "line", "strong", "raised", "paper"];
    return Object.fromEntries(names.map((name) => [name, read("--" + name)]));
  }

  // What a figure's layout needs in the colours of the page, as plotly's dotted keys.
  function scheme(layout) {
    const c = colours();
    const change = {
      "font.color": c.ink, "font.family": "system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif", "font.size": 12.5,
      "hoverlabel.bgcolor": c.raised, "hoverlabel.bordercolor": c.strong, "hoverlabel.font.color": c.ink,
      "modebar.color": c.soft, "modebar.activecolor": c.ink, "modebar.bgcolor": "rgba(0,0,0,0)"
    };
    for (const key of Object.keys(layout)) {
      if (/^[xy]axis\d*$/.test(key)) {
        change[key + ".gridcolor"] = c.line;
        change[key + ".zerolinecolor"] = c.strong;
        change[key + ".linecolor"] = c.strong;
        change[key + ".spikecolor"] = c.strong;
      }
      if (/^scene\d*$/.test(key)) {
        for (const axis of ["xaxis", "yaxis", "zaxis"]) {
          change[key + "." + axis + ".gridcolor"] = c.line;
          change[key + "." + axis + ".color"] = c.ink;
        }
      }
    }
    return change;
  }

  function put(object, dotted, value) {
    const parts = dotted.split(".");
    const last = parts.pop();
    for (const part of parts) object = object[part] = object[part] || {};
    object[last] = value;
  }

  function draw(holder) {
    const figure = JSON.parse(holder.querySelector("script").textContent);
    for (const trace of figure.data) if (trace.x === null) trace.x = figure.data[0].x;
    const change = scheme(figure.layout);
    for (const key of Object.keys(change)) put(figure.layout, key, change[key]);
    const small = holder.parentElement.classList.contains("small-figures");
    if (figure.layout.scene && !webgl()) {
      holder.textContent = "This browser draws nothing that can be turned.";
      return Promise.resolve(holder);
    }
    return Plotly.newPlot(holder, figure.data, figure.layout, config(figure, small)).then(() => makeRoom(holder));
  }

  function webgl() {
    return Boolean(document.createElement("canvas").getContext("webgl"));
  }

  // How many rows a legend takes, and which names of sections would cover each other, shows once they are drawn.
  function makeRoom(holder) {
    const change = {};
    const legend = holder.querySelector(".legend");
    const plot = holder.querySelector(".nsewdrag");
    if (legend && plot) {
      const names = legend.getBoundingClientRect();
      const bar = holder.querySelector(".modebar");
      const beside = bar ? bar.getBoundingClientRect() : { left: Infinity, height: 0 };
      const title = holder.querySelector(".gtitle");
      const line = ((holder.layout.annotations || []).length ? 18 : 0) + (title ? title.getBoundingClientRect().height + 8 : 0);
      const top = Math.ceil(names.height + line + 6 + (names.right > beside.left ? beside.height : 0));
      if (top > holder.layout.margin.t) {
        change["margin.t"] = top;
        change.height = holder.layout.height + top - holder.layout.margin.t;
      }
    }
    let end = -Infinity;
    for (const name of holder.querySelectorAll(".annotation")) {
      const box = name.getBoundingClientRect();
      if (box.left < end + 4 || box.right > holder.getBoundingClientRect().right) {
        change["annotations[" + name.dataset.index + "].visible"] = false;
      } else end = box.right;
    }
    return Object.keys(change).length ? Plotly.relayout(holder, change) : holder;
  }

  function recolour() {
    for (const holder of holders) if (holder.layout) Plotly.relayout(holder, scheme(holder.layout));
  }

  // One figure at a time, so that the page can be scrolled meanwhile; what is folded away has no width, and waits for being asked.
  const folds = Array.from(document.querySelectorAll("details")).filter((fold) => fold.querySelector(".figure"));
  const open = holders.filter((holder) => !holder.closest("details:not([open])"));
  let next = 0;
  function drawNext() {
    if (next < open.length) draw(open[next++]).then(() => setTimeout(drawNext, 0));
    else document.documentElement.dataset.drawn = "all";
  }

  // plotly.js is packed within the page; a browser that cannot unpack it shows the tables.
  async function unpack() {
    const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), (mark) => mark.charCodeAt(0));
    const source = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
    const script = document.createElement("script");
    script.textContent = source;
    document.head.append(script);
  }

  function begin() {
    drawNext();
    for (const fold of folds) {
      fold.addEventListener("toggle", () => {
        if (fold.open) for (const holder of fold.querySelectorAll(".figure")) if (!holder.layout) draw(holder);
      });
    }
    dark.addEventListener("change", recolour);
    window.addEventListener("beforeprint", recolour);
    window.addEventListener("afterprint", recolour);
  }

  if (window.DecompressionStream) unpack().then(begin);
  else document.getElementById("old").hidden = false;
})();
