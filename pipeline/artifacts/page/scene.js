// The arms on a canvas: no perspective, links and solids painted from the back to the front.
function makeScene(canvas, runs, motions) {
  "use strict";
  const view = { azimuth: -0.95, elevation: 0.42, zoom: 1, shift: [0, 0] };
  const flat = runs.every((run) => run.flat === runs[0].flat) ? runs[0].flat : null;
  const FACES = [
    [0, 1, 3, 2],
    [4, 5, 7, 6],
    [0, 1, 5, 4],
    [2, 3, 7, 6],
    [0, 2, 6, 4],
    [1, 3, 7, 5],
  ];
  const INK = "#1a202c",
    PATH = "#b83280",
    SOLID = "#c8463c",
    GROUND = "#8a8f98",
    POSES = 14;
  const { middle, size, low, span } = extent(),
    tile = 10 ** Math.floor(Math.log10(size / 2)) / 2; // [m] of the floor

  // The view that all of it fills; turning it later changes no size.
  function reset() {
    const from = { 0: [0, 0], 1: [-Math.PI / 2, 0], 2: [-Math.PI / 2, Math.PI / 2] }[flat] || [-0.95, 0.42];
    Object.assign(view, { azimuth: from[0], elevation: from[1], zoom: 1, shift: [0, 0] });
    const ends = [0, 1, 2, 3, 4, 5, 6, 7].map((n) => project(low.map((v, i) => v + ((n >> i) & 1) * span[i])));
    const [wide, high] = ["x", "y"].map(
      (key) => Math.max(...ends.map((p) => p[key])) - Math.min(...ends.map((p) => p[key])),
    );
    view.zoom = 0.9 * Math.min(canvas.width / wide, canvas.height / high);
  }

  function extent() {
    const low = [1e9, 1e9, 1e9],
      high = [-1e9, -1e9, -1e9];
    const take = (p, r) =>
      p.forEach((v, i) => {
        if (Number.isFinite(v)) {
          low[i] = Math.min(low[i], v - r);
          high[i] = Math.max(high[i], v + r);
        }
      });
    const all = (values, step) => {
      for (let i = 0; i + 2 < values.length; i += step) take(values.slice(i, i + 3), 0);
    };
    motions.forEach((m) => {
      all(m.points, 3);
      if (m.box) all(m.box, 3);
    });
    runs.forEach((run) => {
      all(run.path, 3);
      if (run.foot) take(run.foot, 0);
      [...run.obstacles, ...run.limbs].forEach((o) =>
        o.ends ? o.ends.forEach((p) => take(p, o.radius)) : o.corners.forEach((p) => take(p, 0)),
      );
    });
    const wide = high.map((v, i) => v - low[i]);
    return { middle: low.map((v, i) => v + wide[i] / 2), size: Math.hypot(...wide) || 1, low, span: wide };
  }

  function project(p) {
    const [ca, sa, ce, se] = [
      Math.cos(view.azimuth),
      Math.sin(view.azimuth),
      Math.cos(view.elevation),
      Math.sin(view.elevation),
    ];
    const [x, y, z] = p.map((v, i) => v - middle[i]);
    const scale = ((0.92 * Math.min(canvas.width, canvas.height)) / size) * view.zoom;
    const across = -sa * x + ca * y,
      up = -ca * se * x - sa * se * y + ce * z,
      depth = ca * ce * x + sa * ce * y + se * z;
    return {
      x: canvas.width / 2 + scale * across + view.shift[0],
      y: canvas.height / 2 - scale * up + view.shift[1],
      depth,
      scale,
    };
  }

  // The points of a motion's arm at a time, between two knots.
  function pose(motion, time, values = motion.points) {
    const t = motion.time,
      last = t.length - 1,
      width = values.length / t.length;
    let k = 0,
      top = last;
    while (top - k > 1) {
      const half = (k + top) >> 1;
      if (t[half] <= time) k = half;
      else top = half;
    }
    const share = last ? Math.min(1, Math.max(0, (time - t[k]) / (t[top] - t[k] || 1))) : 0;
    const points = [];
    for (let i = 0; i < width; i += 3) {
      points.push(
        [0, 1, 2].map((c) => {
          const a = values[k * width + i + c],
            b = values[top * width + i + c];
          return a + share * (b - a);
        }),
      );
    }
    return points;
  }

  function draw(time, focus, ghosts) {
    const pen = canvas.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.lineCap = pen.lineJoin = "round";
    const shown = motions.filter((m) => m.on),
      seen = new Set(shown.map((m) => m.run));
    const thick = Math.max(2, 0.011 * Math.min(canvas.width, canvas.height));
    const line = (points, color, width, alpha = 1) => {
      pen.globalAlpha = alpha;
      pen.strokeStyle = color;
      pen.lineWidth = width;
      pen.beginPath();
      let down = false;
      points.forEach((p) => {
        if (!p.every(Number.isFinite)) {
          down = false;
          return;
        }
        const s = project(p);
        if (down) pen.lineTo(s.x, s.y);
        else pen.moveTo(s.x, s.y);
        down = true;
      });
      pen.stroke();
      pen.globalAlpha = 1;
    };
    const triples = (values, step = 3) => {
      const out = [];
      for (let i = 0; i < values.length; i += step) out.push([...values.slice(i, i + 3)]);
      return out;
    };
    if (flat === null || flat === 2) floor(line);
    runs.forEach((run, i) => {
      if (seen.has(i)) line(triples(run.path), PATH, 2.2 * thick, 0.22);
    });
    const items = [];
    const solid = (depth, paint) => items.push({ depth, paint }),
      under = (_, paint) => solid(-1e9, paint);
    runs.forEach((run, i) => {
      if (!seen.has(i)) return;
      const stands = (o, color, alpha) => {
        if (o.ends) {
          const [a, b] = o.ends.map(project);
          solid((a.depth + b.depth) / 2, () => line(o.ends, color, 2 * o.radius * a.scale, alpha + 0.1));
        } else box(o.corners, color, alpha, o.ground ? under : solid, pen, o.faces);
      };
      run.obstacles.forEach((o) => (o.ground ? stands(o, GROUND, 0.18) : stands(o, SOLID, 0.35)));
      run.limbs.forEach((o) => stands(o, GROUND, 0.25));
    });
    shown.forEach((m) => {
      const own = m === focus,
        width = m.points.length / m.time.length,
        gone = m.until !== null && time > m.until;
      line(
        triples(m.points, 3).filter((_, i) => (3 * i + 3) % width === 0),
        m.color,
        own ? 2.5 : 1.5,
        own ? 1 : 0.6,
      );
      if (ghosts && own) {
        for (let k = 0; k < POSES; k += 1) line(pose(m, (m.end * k) / (POSES - 1)), m.color, 1.5, 0.18);
      }
      if (runs[m.run].foot) line([runs[m.run].foot, pose(m, time)[0]], "#a0a8b4", 2 * thick, 0.6);
      const color = gone ? "#a0a8b4" : m.color,
        points = pose(m, time);
      if (m.box) box(pose(m, time, m.box), color, 0.25, solid, pen);
      if (m.frame) carried(runs[m.run].tool, pose(m, time, m.frame), color, solid, pen, line);
      for (let i = 0; i + 1 < points.length; i += 1) {
        const pair = [points[i], points[i + 1]];
        if (!pair.flat().every(Number.isFinite)) continue;
        const [a, b] = pair.map(project);
        solid((a.depth + b.depth) / 2, () => {
          line(pair, color, thick * (own ? 1.5 : 1), own ? 1 : 0.75);
          dot(pen, a, thick * (own ? 0.95 : 0.7), "#fff", color);
        });
      }
      const tip = project(points[points.length - 1]);
      solid(tip.depth + 1e-6, () => dot(pen, tip, thick * 0.75, color, INK));
      if (own) canvas.dataset.tip = points[points.length - 1].map((v) => v.toFixed(5)).join(" ");
    });
    items.sort((a, b) => a.depth - b.depth).forEach((item) => item.paint());
  }

  // What the end effector carries, in its frame (origin, and a metre along x, y and z from there).
  function carried(tool, [origin, ...axes], color, solid, pen, line) {
    const placed = (p) => origin.map((v, c) => v + axes.reduce((sum, axis, i) => sum + p[i] * (axis[c] - v), 0));
    tool.forEach((o) => {
      if (!o.ends) return box(o.corners.map(placed), color, 0.3, solid, pen, o.faces);
      const ends = o.ends.map(placed),
        [a, b] = ends.map(project);
      solid((a.depth + b.depth) / 2, () => line(ends, color, 2 * o.radius * a.scale, 0.35));
    });
  }

  function dot(pen, at, radius, fill, edge) {
    pen.fillStyle = fill;
    pen.strokeStyle = edge;
    pen.lineWidth = Math.max(1, radius / 3);
    pen.beginPath();
    pen.arc(at.x, at.y, radius, 0, 2 * Math.PI);
    pen.fill();
    pen.stroke();
  }

  function box(corners, color, alpha, solid, pen, faces = FACES) {
    if (!corners.flat().every(Number.isFinite)) return;
    const flatCorners = corners.map(project);
    faces.forEach((face) => {
      const own = face.map((i) => flatCorners[i]);
      solid(own.reduce((sum, p) => sum + p.depth, 0) / own.length, () => {
        pen.globalAlpha = alpha;
        pen.fillStyle = color;
        pen.strokeStyle = color;
        pen.lineWidth = 1;
        pen.beginPath();
        own.forEach((p, i) => (i ? pen.lineTo(p.x, p.y) : pen.moveTo(p.x, p.y)));
        pen.closePath();
        pen.fill();
        pen.globalAlpha = faces.length > 6 ? alpha / 2 : Math.min(1, 2 * alpha); // many edges would hide the faces
        pen.stroke();
        pen.globalAlpha = 1;
      });
    });
  }

  // A grid below everything, one line every so many metres.
  function floor(line) {
    const step = tile;
    const [x0, y0] = [0, 1].map((i) => Math.floor(low[i] / step) * step);
    const [nx, ny] = [0, 1].map((i) => Math.ceil((low[i] + span[i]) / step - [x0, y0][i] / step));
    for (let i = 0; i <= nx; i += 1)
      line(
        [
          [x0 + i * step, y0, low[2]],
          [x0 + i * step, y0 + ny * step, low[2]],
        ],
        "#e2e8f0",
        1.5,
      );
    for (let i = 0; i <= ny; i += 1)
      line(
        [
          [x0, y0 + i * step, low[2]],
          [x0 + nx * step, y0 + i * step, low[2]],
        ],
        "#e2e8f0",
        1.5,
      );
  }

  function handle(redraw) {
    let held = null;
    canvas.addEventListener("pointerdown", (e) => {
      held = [e.clientX, e.clientY];
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointerup", () => {
      held = null;
    });
    canvas.addEventListener("pointermove", (e) => {
      if (!held) return;
      const dx = e.clientX - held[0],
        dy = e.clientY - held[1],
        ratio = canvas.width / canvas.clientWidth;
      held = [e.clientX, e.clientY];
      if (flat !== null || e.shiftKey || e.buttons === 4) {
        view.shift[0] += dx * ratio;
        view.shift[1] += dy * ratio;
      } else {
        view.azimuth -= 0.008 * dx;
        view.elevation = Math.min(1.57, Math.max(-1.57, view.elevation + 0.008 * dy));
      }
      redraw();
    });
    canvas.addEventListener(
      "wheel",
      (e) => {
        e.preventDefault();
        view.zoom *= Math.exp(-0.0012 * e.deltaY);
        redraw();
      },
      { passive: false },
    );
    canvas.addEventListener("dblclick", () => {
      reset();
      redraw();
    });
  }

  reset();
  return { draw, handle, tile };
}
