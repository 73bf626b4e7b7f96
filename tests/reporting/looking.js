// Measures the page that it stands in, once every open figure is drawn, and puts what it finds in its place.
(function () {
  "use strict";
  const LABELS = ".xtick text, .ytick text, .legendtext, .gtitle, .xtitle, .ytitle, .x2title, .y2title, .y3title, .annotation-text, "
    + ".cbtitle text, .cbaxis text, .scene text";

  function shown(element) {
    const box = element.getBoundingClientRect();
    const style = getComputedStyle(element);
    return box.width > 0 && box.height > 0 && style.visibility !== "hidden" && style.opacity !== "0" && element.textContent.trim();
  }

  // Rotated words have boxes that cover more than the words do.
  function turned(element) {
    const angle = /rotate\((-?[\d.]+)/.exec(element.getAttribute("transform") || "");
    return angle && Math.abs(parseFloat(angle[1])) % 90 !== 0;
  }

  function overlaps(holder) {
    const found = [];
    const labels = Array.from(holder.querySelectorAll(LABELS)).filter((label) => shown(label) && !turned(label));
    const boxes = labels.map((label) => label.getBoundingClientRect());
    for (let i = 0; i < boxes.length; i++) {
      for (let j = 0; j < i; j++) {
        const [a, b] = [boxes[i], boxes[j]];
        const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
        const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        if (wide > 2 && high > 3) {
          found.push((holder.getAttribute("aria-label") || "") + ": '" + labels[j].textContent + "' and '" + labels[i].textContent + "'");
        }
      }
    }
    return found;
  }

  function cut(holder) {
    const edge = holder.getBoundingClientRect();
    return Array.from(holder.querySelectorAll(LABELS)).filter(shown).filter((label) => {
      const box = label.getBoundingClientRect();
      return box.left < edge.left - 2 || box.right > edge.right + 2 || box.top < edge.top - 2 || box.bottom > edge.bottom + 2;
    }).map((label) => (holder.getAttribute("aria-label") || "") + ": '" + label.textContent + "'");
  }

  async function serious() {
    if (!window.axe) return null;
    const result = await window.axe.run(document, { resultTypes: ["violations"] });
    return result.violations.filter((rule) => ["serious", "critical"].includes(rule.impact)).map(
      (rule) => rule.id + ": " + rule.help + " (" + rule.nodes.length + ", such as " + rule.nodes[0].html.slice(0, 160) + ")"
    );
  }

  async function tell() {
    const holders = Array.from(document.querySelectorAll(".figure, .scene")).filter((one) => one.getBoundingClientRect().height > 0);
    const first = holders.find((one) => one.classList.contains("figure"));
    const ink = getComputedStyle(document.body).color.match(/\d+/g).map(Number);
    const told = {
      scrolls: document.documentElement.scrollWidth - window.innerWidth,
      first_figure: first ? first.getBoundingClientRect().top + window.scrollY : null,
      overlaps: holders.flatMap(overlaps),
      cut: holders.flatMap(cut),
      dark: ink[0] > 128,
      serious: await serious()
    };
    const place = document.createElement("pre");
    place.id = "looked";
    place.textContent = JSON.stringify(told);
    document.body.replaceChildren(place);
    document.head.replaceChildren();
  }

  const wait = setInterval(() => {
    const figures = document.querySelector(".figure");
    if (figures && document.documentElement.dataset.drawn !== "all") return;
    clearInterval(wait);
    setTimeout(tell, 300);
  }, 50);
})();
