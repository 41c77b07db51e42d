// Filters of the report: they hide elements of scenes and engines that are not selected, and the lines of these engines in plots.
"use strict";
(() => {
  const form = document.getElementById("filters"), cells = [...document.querySelectorAll("#matrix td[data-status]")];
  const total = new Set(cells.map((cell) => cell.parentElement.dataset.scene)).size;

  const apply = () => {
    const engines = new Set([...form.querySelectorAll("[name=engine]:checked")].map((box) => box.value));
    const part = form.elements.scene.value.trim().toLowerCase(), status = form.elements.status.value;
    const found = new Set(cells
      .filter((cell) => engines.has(cell.dataset.engine) && (!status || cell.dataset.status === status))
      .map((cell) => cell.parentElement.dataset.scene)
      .filter((scene) => scene.toLowerCase().includes(part)));
    for (const element of document.querySelectorAll("[data-scene], [data-engine]")) {
      const { scene, engine } = element.dataset;
      element.classList.toggle("left-out", (scene !== undefined && !found.has(scene)) || (engine !== undefined && !engines.has(engine)));
    }
    const unchecked = [...form.querySelectorAll("[name=engine]:not(:checked)")].map((box) => box.dataset.label);
    document.dispatchEvent(new CustomEvent("dropspin:engines", { detail: unchecked }));
    form.elements.shown.textContent = found.size === total && total > 1 ? `all ${total} scenes` : `${found.size} of ${total} scene${total > 1 ? "s" : ""}`;
  };

  // On a narrow screen the filters stay closed until they are needed, so that the results are on the first screen.
  const wide = matchMedia("(min-width: 40rem)"), details = form.querySelector("details");
  const unfold = () => { details.open = wide.matches; };
  wide.addEventListener("change", unfold);
  unfold();
  form.hidden = false;
  form.addEventListener("input", apply);
  form.addEventListener("submit", (event) => event.preventDefault());
  apply();
})();
