// The viewer of the motions of a scene. For each one a page has an element with data-replay="ID", and its data as JSON in the element with that id.
"use strict";
(() => {
{% include "replay/vectors.js" %}
{% include "replay/motions.js" %}
{% include "replay/camera.js" %}
{% include "replay/bodies.js" %}
{% include "replay/drawing.js" %}
{% include "replay/controls.js" %}
{% include "replay/viewer.js" %}
  const style = document.createElement("style");
  style.textContent = `{% include "replay/replay.css" %}`;
  document.head.append(style);

  // A viewer is made when its button is pressed, or where the page is of replays, when it comes near the window: pages of many scenes open fast.
  const open = (home) => {
    home.viewer = new Viewer(home, JSON.parse(document.getElementById(home.dataset.replay).textContent));
  };
  const openNear = new IntersectionObserver((entries) => {
    for (const { target } of entries.filter((entry) => entry.isIntersecting)) {
      openNear.unobserve(target);
      open(target);
    }
  }, { rootMargin: "300px" });
  for (const home of document.querySelectorAll("[data-replay]")) {
    home.hidden = false;
    if ("open" in home.dataset) openNear.observe(home);
    else home.append(made("button", { type: "button", onclick: () => { open(home); home.viewer.button.focus(); } }, "Replay in 3D"));
  }
})();
