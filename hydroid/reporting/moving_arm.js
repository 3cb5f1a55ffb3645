// Draws an arm in motion: the measured arm, over it the simulated one, and a button and a slider for the time.
"use strict";
function moveArm(host, arm) {
  const last = arm.time.length - 1;
  const play = host.querySelector("button"), slider = host.querySelector("input"), words = host.querySelector("output");
  const pictures = host.querySelector(".views");
  const svg = (name) => document.createElementNS("http://www.w3.org/2000/svg", name);

  const views = Object.entries(arm.views).map(([name, view]) => {
    const picture = pictures.appendChild(svg("svg"));
    picture.setAttribute("viewBox", `0 0 ${view.size[0]} ${view.size[1]}`);
    picture.setAttribute("role", "img");
    picture.setAttribute("aria-label", `The arm from ${name === "side" ? "the side" : name}`);
    picture.style.flexGrow = view.size[0]; // both to the same scale
    const polygons = ["measured", "simulated"].flatMap((which) => view.order.map((number) => {
      const shape = arm.shapes[number], poses = arm.poses[which][shape.body];
      if (which === "measured" && poses.length === 1) return null; // what stands still is drawn once
      const polygon = picture.appendChild(svg("polygon"));
      polygon.setAttribute("class", poses.length === 1 ? "still" : which);
      return { polygon, poses, corners: shape.corners };
    })).filter(Boolean);
    return { axes: view.axes, corner: view.corner, polygons };
  });

  // the outline of points: Andrew's monotone chain
  function outline(points) {
    points.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const half = (all) => {
      const chain = [];
      for (const [x, y] of all) {
        for (; chain.length > 1; chain.pop()) {
          const [p, q] = chain.slice(-2);
          if ((q[0] - p[0]) * (y - p[1]) > (q[1] - p[1]) * (x - p[0])) break;
        }
        chain.push([x, y]);
      }
      return chain.slice(0, -1);
    };
    return [...half(points), ...half(points.reverse())];
  }

  function show(time) {
    let k = arm.time.findIndex((t) => t > time) - 1;
    if (k < 0) k = last - 1;
    const share = Math.min(1, (time - arm.time[k]) / (arm.time[k + 1] - arm.time[k]));
    const between = (a, b) => a + share * (b - a);
    const at = (rows) => { const a = rows[k] ?? rows[0], b = rows[k + 1] ?? a; return a.map((v, i) => between(v, b[i])); };
    for (const { axes, corner, polygons } of views) {
      const camera = at(axes);
      for (const { polygon, poses, corners } of polygons) {
        const m = at(poses);
        // from the part to the picture, in one step
        const row = (i, j) => camera[3 * i] * m[j] + camera[3 * i + 1] * m[4 + j] + camera[3 * i + 2] * m[8 + j];
        const [a, b] = [0, 1].map((i) => [row(i, 0), row(i, 1), row(i, 2), row(i, 3) + corner[i]]);
        const places = corners.map(([x, y, z]) => [a[0] * x + a[1] * y + a[2] * z + a[3], b[0] * x + b[1] * y + b[2] * z + b[3]]);
        polygon.setAttribute("points", outline(places).map((p) => p.map((v) => v.toFixed(1)).join()).join(" "));
      }
    }
    slider.value = time;
    const errors = Object.entries(arm.errors).map(([name, e]) => `${name} ${between(e[k], e[k + 1]).toFixed(2).replace("-", "−")}${arm.units[name]}`);
    words.textContent = `${time.toFixed(1)} s. Measured minus simulated: ${errors.join(", ")}`;
  }

  let began = 0, running = false;
  function step(now) {
    if (!running) return;
    const time = (now - began) / 1000;
    if (time > arm.time[last]) began = now - 1000 * arm.time[0];
    show(Math.min(time, arm.time[last]));
    requestAnimationFrame(step);
  }
  function run(on) {
    running = on;
    play.textContent = on ? "❚❚ Pause" : "▶ Play";
    if (on) { began = performance.now() - 1000 * slider.value; requestAnimationFrame(step); }
  }
  Object.assign(slider, { min: arm.time[0], max: arm.time[last], step: 0.05 });
  slider.oninput = () => { run(false); show(+slider.value); };
  play.onclick = () => run(!running);
  host.addEventListener("leave", () => run(false));
  run(false);
  show(arm.time[arm.start]);
}
