// Draws an arm in motion: the measured arm, over it the simulated one, and a button and a slider for the time.
"use strict";
function moveArm(host, arm) {
  const [width, height] = arm.size, last = arm.time.length - 1;
  const picture = host.querySelector("svg"), play = host.querySelector("button");
  const slider = host.querySelector("input"), words = host.querySelector("output");
  picture.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const polygons = ["measured", "simulated"].flatMap((name) => arm.shapes.map((shape) => {
    const poses = arm.poses[name][shape.body];
    if (name === "measured" && poses.length === 1) return null; // what stands still is drawn once
    const polygon = document.createElementNS("http://www.w3.org/2000/svg", "polygon");
    polygon.setAttribute("class", poses.length === 1 ? "still" : name);
    picture.append(polygon);
    return { polygon, poses, corners: shape.corners };
  })).filter(Boolean);

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
    for (const { polygon, poses, corners } of polygons) {
      const a = poses[k] ?? poses[0], b = poses[k + 1] ?? a, m = a.map((v, i) => between(v, b[i]));
      const places = corners.map(([x, y, z]) => [m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7]]);
      polygon.setAttribute("points", outline(places).map((p) => p.map((v) => v.toFixed(1)).join()).join(" "));
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
  run(false);
  show(arm.time[arm.start]);
}
