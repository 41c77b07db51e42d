// The table of all results of a scene is built from its data when it is opened, and a scene is opened where a link leads to it.
"use strict";
(() => {
  const COLUMNS = ["result", "engine", "time step", "value", "bound, or 95 % interval", "verdict", "cause", "reason"];
  const cell = (name, text, attributes = {}) => Object.assign(document.createElement(name), { textContent: text }, attributes);

  for (const home of document.querySelectorAll("[data-results]")) {
    home.addEventListener("toggle", () => {
      const { rows, texts, scene } = JSON.parse(document.getElementById(home.dataset.results).textContent);
      const head = document.createElement("tr"), body = document.createElement("tbody");
      head.append(...COLUMNS.map((text) => cell("th", text, { scope: "col" })));
      for (const [engine, hasFailed, ...numbers] of rows) {
        const row = body.appendChild(document.createElement("tr"));
        row.dataset.engine = engine;
        if (hasFailed) row.className = "failed";
        row.append(...numbers.map((number, i) => cell(i ? "td" : "th", texts[number], i ? {} : { scope: "row" })));
      }
      const table = cell("table", "", { className: "results" }), box = cell("div", "", { className: "scroll" });
      table.append(document.createElement("thead"), body);
      table.tHead.append(head);
      box.setAttribute("role", "region");
      box.setAttribute("aria-label", `All results of ${scene}`);
      box.append(table);
      stopWhereItScrolls.observe(box);
      home.append(box);
      document.getElementById("filters").dispatchEvent(new Event("input"));
    }, { once: true });
  }

  const reveal = () => {
    const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (target instanceof HTMLDetailsElement) {
      target.open = true;
      target.scrollIntoView();
    }
  };
  addEventListener("hashchange", reveal);
  reveal();
})();
