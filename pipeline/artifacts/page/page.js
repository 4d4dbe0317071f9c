// What belongs together on the page: the clock, the arms, the table of motions, the plots and the plane of costs.
(function () {
  "use strict";
  const runs = JSON.parse(document.getElementById("data").textContent).runs;
  const floats = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const motions = [];
  runs.forEach((run, number) => {
    run.path = floats(run.path);
    run.motions.forEach((m) => {
      m.run = number;
      m.name = runs.length > 1 ? `${run.name}: ${m.label}` : m.label;
      ["time", "points", "box", "frame"].forEach((key) => {
        if (m[key]) m[key] = floats(m[key]);
      });
      [m.joints, m.lines].forEach((own) =>
        Object.keys(own).forEach((key) => {
          own[key] = floats(own[key]);
        }),
      );
      m.end = m.time[m.time.length - 1];
      motions.push(m);
    });
  });
  const get = (id) => document.getElementById(id);
  const canvas = get("arm"),
    slider = get("time"),
    shown = get("shown"),
    play = get("play"),
    joint = get("joint"),
    poses = get("poses");
  const end = Math.max(...motions.map((m) => m.end));
  const UNITS = {
    "kinetic energy": "J",
    "kinetic-energy integral": "J s",
    "squared-torque integral": "N² m² s",
    "path error": "m",
    clearance: "m",
    "turn of the base": "rad",
    "base-rotation integral": "rad²/s",
  };
  let focus = motions.find((m) => m.first) || motions[0];
  focus.on = true;
  let time = 0,
    playing = null;

  canvas.width = 1200;
  canvas.height = runs.every((run) => run.flat !== null) ? 900 : 1000;
  slider.max = end;
  slider.step = end / 2000;
  const scene = makeScene(canvas, runs, motions);
  const plots = makePlots(get("plots"), (t) => setTime(t));
  const planes = runs.map((run) => run.plane).filter(Boolean);
  const plane = makeOwnPlane();
  get("tile").textContent = `squares of ${+scene.tile.toPrecision(2)} m`;
  const redraw = () => scene.draw(time, focus, poses.checked);

  function makeOwnPlane() {
    const shared = JSON.parse(get("data").textContent).plane || (runs.length === 1 ? planes[0] : null);
    if (!shared) {
      get("plane-part").remove();
      return null;
    }
    get("plane-title").textContent = shared.title;
    return makePlane(get("plane"), shared, motions, (m) => {
      motions.forEach((other) => {
        other.on = other === m;
      });
      choose(m);
    });
  }

  function setTime(t) {
    time = Math.min(end, Math.max(0, t));
    slider.value = time;
    shown.textContent = `${time.toFixed(3)} s`;
    plots.setTime(time);
    redraw();
  }

  function drawPlots() {
    plots.clear();
    const on = motions.filter((m) => m.on),
      one = joint.value === "all" ? null : Number(joint.value);
    const run = runs[focus.run];
    run.bands.forEach((band) => {
      const title =
        one === null ? `${band.kind} of all joints, ${focus.name}` : `${band.kind} of ${run.joints[one].name}`;
      plots.add(
        one === null
          ? {
              title,
              unit: band.unit,
              lines: run.joints.map((own, j) => column(focus, band.kind, j, own.name, own.color, false)),
              limits: limits(run, band),
            }
          : {
              title,
              unit: band.unit,
              lines: on
                .filter((m) => runs[m.run].joints.length > one)
                .map((m) => column(m, band.kind, one, m.name, m.color, m === focus)),
              limits: limits(run, band).slice(one, one + 1),
            },
      );
    });
    Object.keys(UNITS).forEach((name) => {
      const lines = on
        .filter((m) => m.lines[name])
        .map((m) => ({
          label: m.name,
          color: m.color,
          x: m.time,
          y: name === "path error" ? m.lines[name].map((v) => Math.max(v, 1e-12)) : m.lines[name],
          until: m.until,
          bold: m === focus,
        }));
      const margin =
        name === "clearance" && run.margin !== null ? [{ low: run.margin, high: null, color: "#c53030" }] : [];
      if (lines.length)
        plots.add({ title: name, unit: UNITS[name], lines, limits: margin, log: name === "path error" });
    });
    plots.setTime(time);
  }

  function column(m, kind, j, label, color, bold) {
    const width = m.joints[kind].length / m.time.length;
    return {
      label,
      color,
      bold,
      x: m.time,
      y: m.time.map((_, k) => m.joints[kind][k * width + j]),
      until: m.until,
    };
  }

  function limits(run, band) {
    return run.joints.map((own, j) => ({
      low: band.kind === "power" ? null : band.lower[j],
      high: band.upper[j],
      color: own.color,
    }));
  }

  function choose(m) {
    focus = m;
    m.on = true;
    refresh();
  }

  function refresh() {
    document.querySelectorAll("tr[data-motion]").forEach((row) => {
      const m = motions[Number(row.dataset.motion)];
      row.classList.toggle("focus", m === focus);
      row.querySelector("input").checked = m.on;
    });
    const names = runs[focus.run].joints.map((own) => own.name);
    if (joint.dataset.of !== String(focus.run)) {
      joint.replaceChildren(
        new Option("all joints of the chosen motion", "all"),
        ...names.map((name, j) => new Option(`${name} of all motions shown`, j)),
      );
      joint.dataset.of = String(focus.run);
    }
    drawPlots();
    if (plane) plane.show(focus);
    redraw();
  }

  function step(begin) {
    let before = begin;
    const speed = Math.max(1, end / 12); // long motions in at most twelve seconds
    const tick = (now) => {
      if (playing === null) return;
      setTime(time >= end ? 0 : time + (speed * (now - before)) / 1000);
      before = now;
      playing = requestAnimationFrame(tick);
    };
    playing = requestAnimationFrame(tick);
  }

  document.querySelectorAll("tr[data-motion]").forEach((row) => {
    const m = motions[Number(row.dataset.motion)];
    row.querySelector(".swatch").style.background = m.color;
    row.addEventListener("click", (e) => {
      if (e.target.matches("input")) {
        m.on = e.target.checked;
        if (!m.on && m === focus) focus = motions.find((other) => other.on) || m;
        refresh();
      } else choose(m);
    });
  });
  slider.addEventListener("input", () => setTime(Number(slider.value)));
  joint.addEventListener("change", drawPlots);
  poses.addEventListener("change", redraw);
  play.addEventListener("click", () => {
    if (playing !== null) {
      cancelAnimationFrame(playing);
      playing = null;
      play.textContent = "play";
      return;
    }
    play.textContent = "stop";
    step(performance.now());
  });
  addEventListener("keydown", (e) => {
    if (e.key === " " && e.target === document.body) {
      e.preventDefault();
      play.click();
    }
  });
  let waiting = null;
  addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(drawPlots, 200);
  });
  scene.handle(redraw);
  refresh();
  setTime(0);
  const asked = /t=([\d.]+)/.exec(location.hash);
  if (asked) setTime(Number(asked[1]));
  document.body.dataset.ready = "yes";
})();
