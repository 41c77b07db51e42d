// A box that scrolls is a tab stop, so that the keyboard can scroll it; a box that does not scroll is none.
"use strict";
// Printed cells keep their colour. The W3C checker does not know this property, so the style sheet cannot set it.
document.documentElement.style.printColorAdjust = "exact";
// A shadow at its right edge shows that a box continues there.
const markWhereItContinues = (box) => box.classList.toggle("continues", box.scrollLeft + box.clientWidth < box.scrollWidth - 1);
const stopWhereItScrolls = new ResizeObserver((entries) => {
  for (const { target } of entries) {
    if (target.scrollWidth > target.clientWidth) target.tabIndex = 0;
    else target.removeAttribute("tabindex");
    markWhereItContinues(target);
  }
});
for (const box of document.querySelectorAll(".scroll")) stopWhereItScrolls.observe(box);
document.addEventListener("scroll", (event) => { if (event.target.classList?.contains("scroll")) markWhereItContinues(event.target); }, true);
