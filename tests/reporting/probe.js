const problems = [];
addEventListener("error", (e) => problems.push(`error: ${e.message}`));
addEventListener("unhandledrejection", (e) => problems.push(`rejected: ${e.reason}`));
addEventListener("securitypolicyviolation", (e) => problems.push(`refused: ${e.blockedURI}`));
console.error = (...words) => problems.push(`console: ${words.join(" ")}`);
const outlines = (end) => {
  const slider = document.querySelector(".moving input");
  if (!slider) return [];
  slider.value = slider[end];
  slider.oninput();
  return [...document.querySelectorAll(".moving polygon")].map((one) => one.getAttribute("points"));
};
// all elements of a page, those of Bokeh's shadow roots too
const everything = (root) => [...root.querySelectorAll("*")].flatMap(
  (one) => [one, ...(one.shadowRoot ? everything(one.shadowRoot) : [])]);
// the pointer goes over all charts, as a reader's would; what their tooltips say
const tooltips = new Set();
async function hover() {
  for (const layer of everything(document).filter((one) => one.classList.contains("bk-events"))) {
    const { left, top, width, height } = layer.getBoundingClientRect();
    for (let x = 0.1; x < 1; x += 0.2) for (let y = 0.1; y < 1; y += 0.2) {
      const at = { clientX: left + x * width, clientY: top + y * height, pointerType: "mouse", isPrimary: true };
      for (const what of ["pointerover", "pointermove"]) layer.dispatchEvent(new PointerEvent(what, at));
      await new Promise((done) => setTimeout(done, 20));
      everything(document).filter((one) => one.classList.contains("bk-tooltip-row-value"))
        .forEach((one) => tooltips.add(one.textContent));
    }
  }
}
// what is shown after the last cell of a matrix is chosen: its row, and the rows of charts and arms there
function chosen() {
  const cell = [...document.querySelectorAll("[role=tab][data-row]")].at(-1);
  if (!cell) return null;
  cell.click();
  const rows = (what) => [...document.querySelectorAll(what)].filter((e) => !e.hidden && e.offsetParent !== null).map((e) => e.dataset.row);
  return { row: cell.dataset.row, charts: rows(".tab[data-row]"), arms: rows(".beside[data-row]") };
}
const waiting = setInterval(() => {
  if (document.documentElement.dataset.ready !== "yes") return;
  clearInterval(waiting);
  document.querySelectorAll("details").forEach((one) => { one.open = true; });
  setTimeout(async () => {
    await hover();
    const loaded = performance.getEntriesByType("resource").map((e) => e.name);
    const charts = [...document.querySelectorAll(".chart")].filter((e) => e.offsetParent !== null);
    const found = {
      problems, width: innerWidth, content: document.documentElement.scrollWidth,
      requests: loaded.filter((name) => !name.startsWith("data:")),
      empty: charts.filter((e) => !e.querySelector(".panel > div > *")).length, charts: charts.length,
      moved: outlines("min").filter((points, i) => points !== outlines("max")[i]).length,
      headings: [...document.querySelectorAll("h1, h2, h3")].map((e) => +e.tagName[1]),
      unnamed: [...document.querySelectorAll("button, img, [role=group]")]
        .filter((e) => !(e.textContent.trim() || e.alt || e.ariaLabel)).length,
      tooltips: [...tooltips], images: everything(document).filter((one) => one.tagName === "IMG").length,
      ran: globalThis.ran ?? "nothing", chosen: chosen(),
    };
    document.head.replaceChildren();
    document.body.textContent = `FOUND${JSON.stringify(found)}END`;
  }, 2000);
}, 100);
