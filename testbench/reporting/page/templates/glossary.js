// Terms in titles of tables and figures say what they mean on hovering, in the words of the list at the end of the page.
(function () {
  "use strict";
  const COMMON = new Set(["arm", "joint", "plan", "step", "section", "session", "stage", "estimate", "evaluation", "protocol"]);
  const meanings = new Map();
  for (const names of document.querySelectorAll(".glossary dt")) {
    for (const name of names.textContent.split(", ")) {
      if (!COMMON.has(name.toLowerCase())) meanings.set(name.toLowerCase(), names.nextElementSibling.textContent);
    }
  }
  if (!meanings.size) return;
  const escaped = Array.from(meanings.keys()).sort((a, b) => b.length - a.length).map((name) => name.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"));
  const pattern = new RegExp("(?<![\\p{L}\\p{N}_])(" + escaped.join("|") + ")(?![\\p{L}\\p{N}_])", "iu");

  // The first term of a text; an abbreviation is one only as it is written.
  function explain(text) {
    const found = text.data.match(pattern);
    if (!found || (found[0].length < 4 && found[0] !== found[0].toUpperCase())) return;
    const rest = text.splitText(found.index);
    rest.splitText(found[0].length);
    const term = document.createElement("abbr");
    term.title = meanings.get(found[0].toLowerCase());
    rest.replaceWith(term);
    term.append(rest);
  }

  for (const place of document.querySelectorAll("main thead th, main h3, main summary, main .tile .what, main .how p, main .facts dt")) {
    for (const text of Array.from(place.childNodes)) if (text.nodeType === Node.TEXT_NODE) explain(text);
  }
})();
