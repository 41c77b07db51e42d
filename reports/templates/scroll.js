// A box that scrolls is a tab stop, so that the keyboard can scroll it; a box that does not scroll is none.
"use strict";
const stopWhereItScrolls = new ResizeObserver((entries) => {
  for (const { target } of entries) {
    if (target.scrollWidth > target.clientWidth) target.tabIndex = 0;
    else target.removeAttribute("tabindex");
  }
});
for (const box of document.querySelectorAll(".scroll")) stopWhereItScrolls.observe(box);
