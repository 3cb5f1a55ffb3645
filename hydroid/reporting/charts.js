// Unpacks the page's data, draws its charts with Bokeh and makes tabs work. No request is made.
"use strict";
(() => {
  const page = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const touch = matchMedia("(pointer: coarse)").matches;
  const drawn = new Map(); // host element -> {figures, x ranges, visible labels}
  const zooms = new Map(); // row of a matrix -> [start, end] to which its charts are zoomed

  async function unpack(id) {
    const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  }

  const color = (name) => getComputedStyle(page).getPropertyValue(`--${name}`).trim();
  const numbers = (values) => (values ?? []).map((v) => v ?? NaN);

  // [low, high] of all marks that are shown along an axis, with a margin
  function extent(panel, axis, shown) {
    const names = axis === "y" ? panel.rows : panel.columns;
    if (names.length) return axis === "y" ? [names.length - 0.5, -0.5] : [-0.5, names.length - 0.5];
    let low = Infinity, high = -Infinity;
    const log = panel[`log_${axis}`];
    for (const mark of panel.marks) {
      if (mark.label && shown.get(mark.label) === false) continue;
      if (mark.kind === "spans" || (mark.kind === "rule" && axis === "x")) continue;
      const ends = mark.kind === (axis === "y" ? "band" : "bars");
      const others = ends ? [axis, "end"] : [axis];
      for (const name of others) for (const v of mark[name] ?? [])
        if (v !== null && (!log || v > 0)) { low = Math.min(low, v); high = Math.max(high, v); }
    }
    if (!(low <= high)) return log ? [0.1, 1] : [0, 1];
    if (log) return axis === "x" ? [low, high] : [low / 1.4, high * 1.4];
    const linear = axis === "x" && panel.marks.some((m) => m.kind === "line" || m.kind === "step");
    const margin = linear ? 0 : (0.07 * (high - low) || 0.05 * Math.abs(high) || 1);
    return [low - margin, high + margin];
  }

  // squares in the colours of their sign, as strong as their value
  function cells(figure, panel, mark) {
    const value = numbers(mark.end), x = numbers(mark.x), y = numbers(mark.y);
    const data = { x, y, value, name: x.map((column, i) => `${panel.rows[y[i]]}, ${panel.columns[column]}`),
      paint: value.map((v) => color(v > 0 ? "blue" : "orange")), strength: value.map(Math.abs) };
    const source = new Bokeh.ColumnDataSource({ data }), field = (name) => ({ field: name });
    const made = figure.rect(field("x"), field("y"), 1, 1,
      { source, fill_color: field("paint"), fill_alpha: field("strength"), line_color: null });
    if (!touch) figure.add_tools(new Bokeh.HoverTool({ renderers: [made], tooltips: [["", "@name"], ["", "@value{0.00}"]] }));
    return made;
  }

  function addMark(figure, panel, mark, shown) {
    const paint = color(mark.color), alpha = mark.alpha;
    const x = numbers(mark.x), y = numbers(mark.y), end = numbers(mark.end);
    const line = { line_color: paint, line_alpha: alpha, line_width: mark.width };
    let made = [];
    if (mark.kind === "line") made = [figure.line({ x, y, ...line })];
    else if (mark.kind === "step") made = [figure.step({ x, y, mode: "after", ...line })];
    else if (mark.kind === "points")
      made = [figure.scatter({ x, y, marker: "circle", size: mark.width, fill_color: paint,
        fill_alpha: alpha, line_color: color("paper") })];
    else if (mark.kind === "bars")
      made = [figure.hbar({ y, left: x, right: end, height: 0.6, fill_color: paint, fill_alpha: alpha, line_color: null })];
    else if (mark.kind === "cells") made = [cells(figure, panel, mark)];
    else if (mark.kind === "band")
      made = [figure.varea({ x, y1: y, y2: end, fill_color: paint, fill_alpha: alpha })];
    else {
      const models = mark.kind === "rule"
        ? y.map((at) => new Bokeh.Span({ location: at, dimension: "width", level: "underlay", ...line }))
        : x.map((low, i) => new Bokeh.BoxAnnotation({ left: low, right: end[i], fill_color: paint, fill_alpha: alpha, line_color: null, level: "underlay" }));
      models.forEach((model) => figure.add_layout(model));
      made = models;
    }
    for (const one of made) {
      one.visible = !mark.label || shown.get(mark.label) !== false;
      if (mark.label) { one.tags = [mark.label]; one.name = mark.label; }
    }
    // a label is text: Bokeh reads a tooltip's own words as HTML, but not what it fills in for $name
    if (["line", "step", "points"].includes(mark.kind) && mark.label && made.length && !touch)
      figure.add_tools(new Bokeh.HoverTool({ renderers: made, mode: mark.kind === "points" ? "mouse" : "vline", line_policy: "nearest", tooltips: [["", "$name"], ["x", "@x{0.[0000]}"], ["y", "@y{0.[0000]}"]] }));
    return made;
  }

  function axisLook(figure) {
    const soft = color("soft"), line = color("line");
    for (const axis of [...figure.xaxes, ...figure.yaxes])
      Object.assign(axis, { axis_line_color: line, major_tick_line_color: line, minor_tick_line_color: null,
        major_label_text_color: soft, axis_label_text_color: soft, axis_label_text_font_style: "normal",
        axis_label_text_font_size: "13px", major_label_text_font_size: "12px" });
    for (const grid of figure.center.filter((one) => one.grid_line_color !== undefined))
      Object.assign(grid, { grid_line_color: line, grid_line_alpha: 0.6 });
    Object.assign(figure, { background_fill_color: null, border_fill_color: null, outline_line_color: null });
  }

  // names of rows or columns in place of an axis's numbers, as large as the room allows [px]
  function nameTicks(axis, names, room, orientation) {
    if (!names.length) return;
    const size = Math.max(6, Math.min(12, Math.floor((0.9 * room) / names.length)));
    axis.ticker = new Bokeh.FixedTicker({ ticks: names.map((_, i) => i) });
    // two dollars would begin a formula
    axis.major_label_overrides = new Map(names.map((name, i) => [i, name.replaceAll("$$", "$ $")]));
    Object.assign(axis, { major_label_text_font_size: `${size}px`, major_label_orientation: orientation, major_label_policy: new Bokeh.AllLabels(), major_tick_line_color: null });
  }

  const decades = Array.from({ length: 17 }, (_, i) => i - 8);
  const logTicks = () => new Bokeh.FixedTicker({ ticks: decades.flatMap((k) => [1, 2, 5].map((m) => Number(`${m}e${k}`))) });

  function addPanel(panel, shared, shown, width) {
    const xs = extent(panel, "x", shown), ys = panel.y_limits ?? extent(panel, "y", shown);
    const x_range = shared ?? new Bokeh.Range1d({ start: xs[0], end: xs[1] });
    const y_range = new Bokeh.Range1d({ start: ys[0], end: ys[1] });
    const figure = Bokeh.Plotting.figure({
      output_backend: "svg", // sharp on paper too
      height: panel.height, sizing_mode: "stretch_width", toolbar_location: null, tools: touch ? "" : "xbox_zoom",
      x_range, y_range, x_axis_type: panel.log_x ? "log" : "linear", y_axis_type: panel.log_y ? "log" : "linear",
      x_axis_label: panel.x || null, y_axis_label: panel.y || null,
      min_border_left: 76, min_border_right: 16, min_border_top: 8, min_border_bottom: 8,
    });
    if (width < 480) for (const axis of figure.xaxes) axis.ticker.desired_num_ticks = 4;
    for (const [axis, log] of [[figure.xaxes[0], panel.log_x], [figure.yaxes[0], panel.log_y]])
      if (log) {
        // else the largest decade has all ticks, and the others have none
        axis.ticker = logTicks();
        const across = axis === figure.xaxes[0] ? 0 : 1;
        figure.center.filter((one) => one.dimension === across).forEach((grid) => { grid.ticker = axis.ticker; });
        axis.major_label_policy = new Bokeh.NoOverlap({ min_distance: 4 });
        axis.formatter = new Bokeh.BasicTickFormatter(); // 0.1, not a power of ten
      }
    axisLook(figure);
    // lines between rows or columns would only cross what is drawn there
    for (const grid of figure.center.filter((one) => one.dimension !== undefined))
      if ((grid.dimension === 0 ? panel.columns : panel.rows).length) grid.visible = false;
    nameTicks(figure.yaxes[0], panel.rows, panel.height - 60, "horizontal");
    // no room for the names of many columns: those of the rows are the same
    nameTicks(figure.xaxes[0], width < 600 || panel.columns.length > 40 ? panel.columns.map(() => "") : panel.columns, Infinity, "vertical");
    const made = panel.marks.flatMap((mark) => addMark(figure, panel, mark, shown));
    return { panel, figure, made, x_range, y_range, home: xs };
  }

  async function draw(host, chart) {
    const before = drawn.get(host);
    before?.document.clear();
    const shown = before?.shown ?? new Map(chart.panels.flatMap((p) => p.marks).filter((m) => m.label).map((m) => [m.label, !m.off]));
    const cells = host.querySelector(".panels");
    cells.replaceChildren();
    let shared = null;
    const panels = chart.panels.filter((panel) => panel.marks.length).map((panel, i, all) => {
      const one = addPanel(panel, shared, shown, host.clientWidth);
      // panels of one time axis: the last one has its numbers
      if (chart.linked && i < all.length - 1) one.figure.xaxes[0].major_label_text_font_size = "0px";
      if (chart.linked) {
        if (!shared) {
          const all = chart.panels.map((p) => extent(p, "x", shown));
          one.home = [Math.min(...all.map((e) => e[0])), Math.max(...all.map((e) => e[1]))];
          one.x_range.setv({ start: one.home[0], end: one.home[1] });
        }
        shared = one.x_range;
      }
      return one;
    });
    const elements = panels.map((one) => {
      const cell = cells.appendChild(document.createElement("div")), element = document.createElement("div");
      cell.className = "panel";
      element.style.minHeight = `${one.panel.height}px`;
      if (one.panel.title) {
        const title = cell.appendChild(document.createElement("p"));
        title.className = "title";
        title.textContent = one.panel.title;
      }
      return cell.appendChild(element);
    });
    const width = elements[0].clientWidth;
    cells.style.setProperty("--drawn", width);
    const bokeh = new Bokeh.Document();
    panels.forEach((one) => bokeh.add_root(one.figure));
    await Bokeh.embed.add_document_standalone(bokeh, cells, elements);
    drawn.set(host, { document: bokeh, panels, shown, chart });
    const row = chart.linked && host.closest("[data-row]")?.dataset.row;
    if (row) {
      const range = panels[0].x_range;
      for (const end of [range.properties.start, range.properties.end])
        end.change.connect(() => zooms.set(row, [range.start, range.end]));
    }
    zoomAlike(host);
    host.classList.toggle("drawn-dark", dark.matches);
    host.querySelector(":scope > .controls").replaceChildren(
      ...legend(panels, shown), ...(host.dataset.zoom ? [zoomButtons(panels)] : []));
  }

  // charts of one log are zoomed together
  function zoomAlike(host) {
    const zoom = zooms.get(host.closest("[data-row]")?.dataset.row), panels = drawn.get(host)?.panels;
    if (zoom && panels) panels[0].x_range.setv({ start: zoom[0], end: zoom[1] });
  }

  // one button per label, that shows or hides its marks in some panels
  function legend(panels, shown) {
    const used = new Map(panels.flatMap((p) => p.panel.marks).filter((m) => m.label).map((m) => [m.label, m]));
    const keys = [...used.values()].map((mark) => {
      const button = document.createElement("button"), sign = document.createElement("span");
      button.type = "button";
      button.className = "key";
      button.setAttribute("aria-pressed", shown.get(mark.label));
      sign.className = `sign ${mark.kind}`;
      sign.style.setProperty("--paint", `var(--${mark.color})`);
      sign.style.opacity = ["band", "spans"].includes(mark.kind) ? Math.max(mark.alpha, 0.35) : mark.alpha;
      button.append(sign, mark.label);
      button.onclick = () => {
        const on = !shown.get(mark.label);
        shown.set(mark.label, on);
        button.setAttribute("aria-pressed", on);
        for (const p of panels) {
          p.made.filter((one) => one.tags?.[0] === mark.label).forEach((one) => { one.visible = on; });
          if (p.panel.y_limits) continue;
          const [start, end] = extent(p.panel, "y", shown);
          p.y_range.setv({ start, end });
        }
      };
      return button;
    });
    return keys.length > 1 ? keys : [];
  }

  function zoomButtons(panels) {
    const ranges = [...new Map(panels.map((p) => [p.x_range, p])).values()];
    const about = (factor) => (a, b) => { const c = (a + b) / 2, h = factor * (b - a) / 2; return [c - h, c + h]; };
    const step = (share) => (a, b) => [a + share * (b - a), b + share * (b - a)];
    const zoom = document.createElement("span");
    zoom.className = "zoom";
    for (const [text, name, change] of [["+", "zoom in", about(0.5)], ["−", "zoom out", about(2)], ["◀", "move left", step(-0.25)],
      ["▶", "move right", step(0.25)], ["↺", "show all", (_a, _b, home) => home]]) {
      const button = document.createElement("button");
      button.type = "button"; button.textContent = text; button.title = name;
      button.setAttribute("aria-label", name);
      button.onclick = () => ranges.forEach((p) => {
        const [start, end] = change(p.x_range.start, p.x_range.end, p.home);
        p.x_range.setv({ start, end });
      });
      zoom.append(button);
    }
    return zoom;
  }

  const idle = () => new Promise((done) => setTimeout(done, 0));
  let drawings = {};
  async function drawVisible(again = false) {
    const isOut = (host) => Boolean(host.closest("[hidden]"));
    // last those that are drawn for paper alone
    const hosts = [...document.querySelectorAll(".chart")].filter((host) => !host.closest("details:not([open])"));
    for (const host of hosts.sort((a, b) => isOut(a) - isOut(b)))
      if (host.offsetParent !== null && !again && drawn.has(host)) zoomAlike(host);
      else if (host.offsetParent !== null) { await draw(host, drawings[host.dataset.drawing]); await idle(); }
  }

  // of what stands beside the tabs, show that of a row, or the note that there is none
  function besides(section, row) {
    const all = [...section.querySelectorAll(".beside")], own = all.find((one) => one.dataset.row === row);
    for (const one of all) {
      one.hidden = one !== (own ?? all.at(-1));
      if (one.hidden) one.querySelector(".moving")?.dispatchEvent(new Event("leave"));
    }
  }

  function tabs(list) {
    const all = [...list.querySelectorAll("[role=tab]")];
    const choose = (tab) => {
      for (const one of all) {
        const on = one === tab;
        one.setAttribute("aria-selected", on);
        one.tabIndex = on ? 0 : -1;
        document.getElementById(one.getAttribute("aria-controls")).hidden = !on;
      }
      besides(list.closest("section, details"), tab.dataset.row);
      drawVisible();
    };
    all.forEach((tab, i) => {
      tab.onclick = () => choose(tab);
      tab.onkeydown = (event) => {
        const to = { ArrowRight: i + 1, ArrowLeft: i - 1, Home: 0, End: all.length - 1 }[event.key];
        if (to === undefined) return;
        event.preventDefault();
        const next = all[(to + all.length) % all.length];
        choose(next); next.focus();
      };
    });
  }

  // charts are as wide as they are now
  addEventListener("beforeprint", () => document.querySelectorAll(".panels").forEach((one) => {
    if (one.clientWidth) one.style.setProperty("--drawn", one.clientWidth);
  }));

  // what must stand on paper though it is folded
  const opened = [];
  addEventListener("beforeprint", () => document.querySelectorAll("details.printed:not([open])").forEach((one) => { one.open = true; opened.push(one); }));
  addEventListener("afterprint", () => opened.splice(0).forEach((one) => { one.open = false; }));

  async function start() {
    document.querySelectorAll("[role=tablist]").forEach(tabs);
    drawings = JSON.parse(await unpack("content"));
    for (const host of document.querySelectorAll(".moving")) moveArm(host, drawings[host.dataset.drawing]);
    if (document.querySelector(".chart")) {
      const library = await unpack("library");
      const script = document.createElement("script");
      script.textContent = library;
      document.head.append(script);
      Bokeh.set_log_level?.("error");
      await drawVisible();
      document.querySelectorAll("details").forEach((one) => one.addEventListener("toggle", () => one.open && drawVisible()));
      dark.addEventListener("change", () => drawVisible(true));
    }
    page.dataset.ready = "yes";
  }
  addEventListener("DOMContentLoaded", start);
})();
