// A box that scrolls can be reached by keyboard; one that does not is no stop on the way.
"use strict";
const stopWhereItScrolls = new ResizeObserver((entries) => {
  for (const { target } of entries) {
    if (target.scrollWidth > target.clientWidth) target.tabIndex = 0;
    else target.removeAttribute("tabindex");
  }
});
for (const box of document.querySelectorAll(".scroll")) stopWhereItScrolls.observe(box);
