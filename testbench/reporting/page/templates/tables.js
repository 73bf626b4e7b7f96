// Tables: a click on a title sorts, and each can be copied or saved.
(function () {
  "use strict";
  const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";

  // What a cell says as a number; NaN for words.
  function numeric(text) {
    const plain = text.trim().replace(/−/g, "-").replace(/^[<≤≥>]\s*/, "");
    const power = plain.match(/^(-?[\d.]+)·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)/);
    if (power) {
      const sign = power[2].startsWith("⁻") ? -1 : 1;
      const digits = Array.from(power[2].replace("⁻", "")).map((mark) => RAISED.indexOf(mark)).join("");
      return parseFloat(power[1]) * 10 ** (sign * parseInt(digits, 10));
    }
    return /^[-+]?\d/.test(plain) ? parseFloat(plain) : NaN;
  }

  // Numbers before words, whichever way they are ordered.
  function compare(first, second, sign) {
    const [a, b] = [numeric(first), numeric(second)];
    if (isNaN(a) !== isNaN(b)) return isNaN(a) ? 1 : -1;
    return sign * (isNaN(a) ? first.localeCompare(second) : a - b);
  }

  // The rows under each heading within the table; what belongs to the row above goes with it.
  function groupsOf(body) {
    const groups = [{ head: null, items: [] }];
    for (const row of body.rows) {
      const kind = row.className;
      const group = groups[groups.length - 1];
      if (kind.includes("group")) groups.push({ head: row, items: [] });
      else if (/published|continued/.test(kind) && group.items.length) group.items[group.items.length - 1].push(row);
      else group.items.push([row]);
    }
    return groups;
  }

  function sortable(table) {
    const body = table.tBodies[0];
    const heads = Array.from(table.tHead.rows[table.tHead.rows.length - 1].cells);
    const original = groupsOf(body);
    if (original.every((group) => group.items.length < 2)) return;
    heads.forEach((head, column) => {
      if (!head.textContent.trim()) return;
      const button = document.createElement("button");
      button.type = "button";
      button.title = "Sort by this column";
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        const order = { ascending: "descending", descending: "" }[head.getAttribute("aria-sort")] ?? "ascending";
        for (const other of heads) other.removeAttribute("aria-sort");
        if (order) head.setAttribute("aria-sort", order);
        const sign = order === "descending" ? -1 : 1;
        const said = (item) => item[0].cells[column] ? item[0].cells[column].textContent : "";
        for (const group of original) {
          const items = order ? [...group.items].sort((a, b) => compare(said(a), said(b), sign)) : group.items;
          if (group.head) body.append(group.head);
          for (const item of items) body.append(...item);
        }
      });
    });
  }

  function cellsOf(row) {
    return Array.from(row.cells).flatMap((cell) => {
      const text = cell.textContent.replace(/\s+/g, " ").trim().replace(/^−(?=\d)/, "-");
      return [text, ...Array(cell.colSpan - 1).fill("")];
    });
  }

  function lines(table, separator) {
    const quoted = (text) => separator === "," && /[",\n]/.test(text) ? '"' + text.replace(/"/g, '""') + '"' : text;
    return Array.from(table.rows).map((row) => cellsOf(row).map(quoted).join(separator)).join("\n") + "\n";
  }

  function save(name, text) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(["\ufeff" + text], { type: "text/csv" }));
    link.download = name.replace(/[^\p{L}\p{N}]+/gu, "_").slice(0, 80) + ".csv";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  function copy(text) {
    if (navigator.clipboard) return navigator.clipboard.writeText(text);
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
    return Promise.resolve();
  }

  function tool(words, act) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = words;
    button.addEventListener("click", () => act(button));
    return button;
  }

  for (const holder of document.querySelectorAll(".scroll")) {
    const table = holder.querySelector("table");
    sortable(table);
    const tools = document.createElement("div");
    tools.className = "tools";
    tools.append(
      tool("Copy", (button) => copy(lines(table, "\t")).then(() => {
        button.textContent = "Copied";
        setTimeout(() => { button.textContent = "Copy"; }, 1500);
      })),
      tool("CSV", () => save(holder.getAttribute("aria-label"), lines(table, ",")))
    );
    holder.after(tools);
  }
})();
