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
const waiting = setInterval(() => {
  if (document.documentElement.dataset.ready !== "yes") return;
  clearInterval(waiting);
  document.querySelectorAll("details").forEach((one) => { one.open = true; });
  setTimeout(() => {
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
    };
    document.head.replaceChildren();
    document.body.textContent = `FOUND${JSON.stringify(found)}END`;
  }, 2000);
}, 100);
