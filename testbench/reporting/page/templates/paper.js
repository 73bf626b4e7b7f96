// Printing: folded tables open and go to the end, what is wider than a column goes across the page, and figures are drawn to
// their place.
(function () {
  "use strict";
  const root = document.documentElement;
  const LOWER = 0.6; // of the height of a figure
  const LOW = 200; // but not below this [px]
  const places = []; // where each table was

  // Whether a table does not fit a column, or would break its words into many lines there.
  function asksForMore(table, column) {
    if (table.offsetWidth > column + 1) return true;
    table.style.width = "max-content";
    const natural = table.offsetWidth;
    table.style.width = "";
    return natural > 1.6 * column;
  }

  // The tables of each section, open, at the end of the page: there columns need not break between figures. What was found, and
  // what was run, keeps its own.
  function moveTables() {
    const end = document.createElement("section");
    end.id = "tables";
    end.innerHTML = "<h2>Tables</h2>";
    for (const section of document.querySelectorAll("main > section")) {
      const stays = ["answer", "verdict", "run"].includes(section.id) ? "details" : "details, .table";
      const tables = Array.from(section.querySelectorAll(stays)).filter(
        (one) => one.querySelector("table") && !one.matches(".how, .screen") && !one.querySelector(".figure")
          && !one.parentElement.closest("details, .table")
      );
      if (!tables.length) continue;
      const title = document.createElement("h3");
      title.className = "part";
      title.textContent = section.querySelector("h2") ? section.querySelector("h2").textContent : "";
      end.append(title);
      for (const table of tables) {
        const mark = document.createComment("");
        table.replaceWith(mark);
        places.push({ mark, table });
        end.append(table);
        for (const fold of [table, ...table.querySelectorAll("details:not(.how)")]) {
          if (fold.tagName === "DETAILS" && !fold.open) {
            fold.open = true;
            fold.dataset.opened = "for paper";
          }
        }
      }
    }
    if (places.length) document.querySelector("main").append(end);
  }

  // Of each section those that fit a column first, so that the columns break once.
  function order(column) {
    const wide = new Set();
    for (const table of document.querySelectorAll("main table")) {
      const whole = table.closest("#tables > *") || table.closest("details, .table");
      if (asksForMore(table, column)) wide.add(whole);
    }
    for (const whole of wide) whole.classList.add("across");
    for (const whole of document.querySelectorAll("#tables > .across")) {
      let last = whole;
      while (last.nextElementSibling && last.nextElementSibling.tagName !== "H3") last = last.nextElementSibling;
      last.after(whole);
    }
  }

  function toPaper() {
    root.classList.add("paper");
    moveTables();
    order(document.querySelector("main").clientWidth / 2 - 10);
    for (const holder of document.querySelectorAll(".figure")) {
      const width = Math.floor(holder.clientWidth);
      if (!holder.layout || !width) continue;
      const height = holder.layout.height;
      const named = holder.layout.yaxis && holder.layout.yaxis.type === "category"; // a line for each name
      const lower = named ? height : Math.min(height, Math.max(LOW, LOWER * height));
      holder.dataset.height = height;
      Plotly.relayout(holder, { width, height: lower, autosize: false });
    }
  }

  function toScreen() {
    root.classList.remove("paper");
    for (const { mark, table } of places.splice(0)) mark.replaceWith(table);
    for (const fold of document.querySelectorAll("details[data-opened]")) {
      fold.open = false;
      delete fold.dataset.opened;
    }
    const end = document.getElementById("tables");
    if (end) end.remove();
    for (const element of document.querySelectorAll(".across")) element.classList.remove("across");
    for (const holder of document.querySelectorAll(".figure[data-height]")) {
      Plotly.relayout(holder, { width: null, height: Number(holder.dataset.height), autosize: true });
    }
  }

  window.addEventListener("beforeprint", toPaper);
  window.addEventListener("afterprint", toScreen);
})();
