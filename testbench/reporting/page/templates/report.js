(function () {
  "use strict";
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const narrow = window.matchMedia("(max-width: 40rem)");
  const holders = Array.from(document.querySelectorAll(".figure"));
  // The buttons are listed one by one: plotly's own choice has one that uploads the figure.
  const config = {
    responsive: true, displaylogo: false, showSendToCloud: false, plotlyServerURL: "",
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]]
  };

  function colours() {
    const style = getComputedStyle(document.documentElement);
    const read = (name) => style.getPropertyValue(name).trim();
    return { ink: read("--ink"), soft: read("--soft"), line: read("--line"), strong: read("--strong"), raised: read("--raised") };
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
    const change = scheme(figure.layout);
    for (const key of Object.keys(change)) put(figure.layout, key, change[key]);
    const small = holder.parentElement.classList.contains("small-figures");
    return Plotly.newPlot(
      holder, figure.data, figure.layout, small || narrow.matches ? Object.assign({}, config, { displayModeBar: false }) : config
    ).then(() => makeRoom(holder));
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
      const line = (holder.layout.annotations || []).length ? 18 : 0;
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
  drawNext();
  for (const fold of folds) {
    fold.addEventListener("toggle", () => {
      if (fold.open) for (const holder of fold.querySelectorAll(".figure")) if (!holder.layout) draw(holder);
    });
  }

  dark.addEventListener("change", recolour);
  window.addEventListener("beforeprint", () => {
    while (next < open.length) draw(open[next++]);
    for (const holder of holders.filter((one) => one.layout)) {
      const small = holder.parentElement.classList.contains("small-figures");
      Plotly.relayout(holder, Object.assign({ width: small ? 330 : 690 }, scheme(holder.layout)));
    }
  });
  window.addEventListener("afterprint", () => {
    for (const holder of holders) if (holder.layout) Plotly.relayout(holder, Object.assign({ width: null, autosize: true }, scheme(holder.layout)));
  });
})();
