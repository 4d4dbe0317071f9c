// Numbers as axes show them.
function short(v) {
  if (v === null) return "";
  if (v === 0 || (Math.abs(v) >= 1e-3 && Math.abs(v) < 1e5)) return (+v.toPrecision(4)).toString();
  return v.toExponential(2).replace(/\.?0+e/, "e");
}

// Plots over time that share their time and its zoom, and the plane of costs in which motions are chosen.
function makePlots(place, onTime) {
  "use strict";
  const HEIGHT = 190,
    LEGEND = 8,
    REACH = 3;
  let plots = [],
    time = 0,
    zooming = false;

  // Values at `x` of a line through (xs, ys); null outside it and behind what is not a number.
  function at(xs, ys, x) {
    let k = 0,
      top = xs.length - 1;
    if (x < xs[0] || x > xs[top]) return null;
    while (top - k > 1) {
      const half = (k + top) >> 1;
      if (xs[half] <= x) k = half;
      else top = half;
    }
    const share = (x - xs[k]) / (xs[top] - xs[k] || 1),
      y = ys[k] + share * (ys[top] - ys[k]);
    return Number.isFinite(y) ? y : null;
  }

  function range(lines) {
    let low = Infinity,
      high = -Infinity;
    lines.forEach((line) => {
      let ys = [...line.y].filter((y, i) => Number.isFinite(y) && (line.until === null || line.x[i] <= line.until));
      // What a motion does close to its singularity would flatten all others.
      if (line.until !== null && lines.length > 1) {
        ys.sort((a, b) => a - b);
        ys = ys.slice(Math.floor(0.04 * ys.length), Math.ceil(0.96 * ys.length));
      }
      ys.forEach((y) => {
        low = Math.min(low, y);
        high = Math.max(high, y);
      });
    });
    return low <= high ? [low, high] : [0, 1];
  }

  // spec: {title, unit, lines: [{label, color, x, y, until, dash}], limits: [{low, high, color}], log}
  function add(spec) {
    const xs = [...new Set(spec.lines.flatMap((line) => [...line.x]))].sort((a, b) => a - b);
    const data = [
      xs,
      ...spec.lines.map((line) =>
        xs.map((x) => (line.until !== null && x > line.until ? null : at(line.x, line.y, x))),
      ),
    ];
    let [low, high] = range(spec.lines);
    const size = Math.max(Math.abs(low), Math.abs(high)) || 1,
      far = [];
    (spec.limits || []).forEach((limit) =>
      [limit.low, limit.high].forEach((bound) => {
        if (bound === null) return;
        if (Math.abs(bound) <= REACH * size) {
          low = Math.min(low, bound);
          high = Math.max(high, bound);
        } else far.push(Math.abs(bound));
      }),
    );
    const margin = 0.06 * (high - low) || 0.1 * size;
    const ends = spec.log ? [Math.max(1e-12, low), Math.max(1e-11, high)] : [low - margin, high + margin];
    const holder = document.createElement("div");
    holder.className = "plot";
    const head = document.createElement("h3");
    head.textContent = `${spec.title} [${spec.unit}] `;
    if (far.length)
      head.append(
        Object.assign(document.createElement("span"), {
          textContent: `limits from ${+Math.min(...far).toPrecision(4)} on, outside`,
        }),
      );
    holder.append(head);
    place.append(holder);
    const u = new uPlot(
      {
        width: Math.max(300, holder.clientWidth),
        height: HEIGHT,
        cursor: { y: false, drag: { x: true, y: false }, points: { size: 5 } },
        legend: { show: spec.lines.length <= LEGEND },
        scales: { x: { time: false }, y: spec.log ? { distr: 3, range: () => ends } : { range: () => ends } },
        axes: [
          { size: 28, font: "11px system-ui" },
          { size: 62, font: "11px system-ui", values: (_, ticks) => ticks.map(short) },
        ],
        series: [
          { label: "t [s]", value: (_, v) => (v === null ? "" : v.toFixed(3)) },
          ...spec.lines.map((line) => ({
            label: line.label,
            stroke: line.color,
            width: line.bold ? 2.2 : 1.3,
            dash: line.dash,
            spanGaps: false,
            points: { show: false },
            value: (_, v) => (v === null || v === undefined ? "" : (+v.toPrecision(4)).toString()),
          })),
        ],
        hooks: {
          drawClear: [(p) => shade(p, spec.limits || [])],
          setCursor: [
            (p) => {
              if (p.cursor.left >= 0 && p.cursor.event !== null && p.hovered)
                onTime(p.posToVal(p.cursor.left, "x"));
            },
          ],
          setScale: [
            (p, key) => {
              if (key === "x") zoom(p);
            },
          ],
        },
      },
      data,
      holder,
    );
    u.over.addEventListener("mouseenter", () => {
      u.hovered = true;
    });
    u.over.addEventListener("mouseleave", () => {
      u.hovered = false;
    });
    const now = document.createElement("div");
    now.className = "now";
    u.over.append(now);
    plots.push({ u, now, xs });
  }

  // Beyond a limit that all lines share the plot is shaded; every other limit is a broken line of its joint's colour.
  function shade(p, limits) {
    const { ctx, bbox } = p;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const key = (limit) => `${limit.low} ${limit.high}`;
    const shared = new Set(limits.map(key)).size === 1;
    limits.forEach((limit, i) =>
      [limit.low, limit.high].forEach((bound, side) => {
        if (bound === null || (shared && i)) return;
        const y = p.valToPos(bound, "y", true);
        if (shared) {
          ctx.fillStyle = "rgba(197, 48, 48, 0.10)";
          if (side) ctx.fillRect(bbox.left, bbox.top, bbox.width, Math.max(0, y - bbox.top));
          else ctx.fillRect(bbox.left, y, bbox.width, Math.max(0, bbox.top + bbox.height - y));
        }
        ctx.strokeStyle = shared ? "#c53030" : limit.color;
        ctx.lineWidth = 1.2;
        ctx.setLineDash([5, 5]);
        ctx.beginPath();
        ctx.moveTo(bbox.left, y);
        ctx.lineTo(bbox.left + bbox.width, y);
        ctx.stroke();
      }),
    );
    ctx.restore();
  }

  function zoom(p) {
    if (zooming) return;
    zooming = true;
    const { min, max } = p.scales.x;
    plots.forEach(({ u }) => {
      if (u !== p && min !== null) u.setScale("x", { min, max });
    });
    zooming = false;
    setTime(time);
  }

  function setTime(t) {
    time = t;
    plots.forEach(({ u, now, xs }) => {
      const { min, max } = u.scales.x;
      now.style.display = t < min || t > max ? "none" : "";
      now.style.left = `${u.valToPos(t, "x")}px`;
      if (u.legend && u.legend.show !== false && !u.hovered) u.setLegend({ idx: nearest(xs, t) }, false);
    });
  }

  function nearest(xs, t) {
    let k = 0,
      top = xs.length - 1;
    while (top - k > 1) {
      const half = (k + top) >> 1;
      if (xs[half] <= t) k = half;
      else top = half;
    }
    return t - xs[k] <= xs[top] - t ? k : top;
  }

  function clear() {
    plots.forEach(({ u }) => u.destroy());
    plots = [];
    place.replaceChildren();
  }

  return {
    add,
    clear,
    setTime,
    get count() {
      return plots.length;
    },
  };
}

// plane: {title, x, y, step, points: [{motion, x, y, mark, good}]}; a click chooses the nearest point's motion.
function makePlane(place, plane, motions, choose) {
  "use strict";
  const points = [...plane.points].sort((a, b) => a.x - b.x);
  const span = (key) => {
    const all = points.map((p) => p[key]),
      low = Math.min(...all),
      high = Math.max(...all),
      margin = 0.08 * (high - low) || 0.1 * Math.abs(high) || 1;
    return [low - margin, high + margin];
  };
  const [across, up] = [span("x"), span("y")];
  const spot = (u, p) => [u.valToPos(p.x, "x", true), u.valToPos(p.y, "y", true)];
  const values = (_, ticks) => ticks.map(short);
  const labelFont = `${plane.y.length > 40 ? 9 : 11}px system-ui`; // along 300 pixels
  let focus = null;
  const u = new uPlot(
    {
      width: Math.max(300, place.clientWidth),
      height: 360,
      cursor: { drag: { x: false, y: false }, points: { show: false } },
      legend: { show: false },
      scales: { x: { time: false, range: () => across }, y: { range: () => up } },
      axes: [
        { values, label: plane.x, labelSize: 22, font: "11px system-ui", labelFont: "12px system-ui" },
        { values, label: plane.y, size: 66, labelSize: 20, font: "11px system-ui", labelFont },
      ],
      series: [{}, { paths: () => null, points: { show: false } }],
      hooks: { draw: [(p) => paint(p)] },
    },
    [points.map((p) => p.x), points.map((p) => p.y)],
    place,
  );

  function paint(p) {
    const { ctx } = p,
      ratio = devicePixelRatio || 1;
    ctx.save();
    if (plane.step) {
      ctx.strokeStyle = "#cbd5e0";
      ctx.lineWidth = ratio;
      ctx.beginPath();
      points
        .filter((q) => q.good)
        .forEach((q, i, all) => {
          const [x, y] = spot(p, q);
          if (i) ctx.lineTo(x, spot(p, all[i - 1])[1]);
          else ctx.moveTo(x, y);
          ctx.lineTo(x, y);
        });
      ctx.stroke();
    }
    points.forEach((q) => {
      const [x, y] = spot(p, q),
        own = motions[q.motion] === focus;
      ctx.globalAlpha = q.good ? 1 : 0.35;
      ctx.fillStyle = motions[q.motion].color;
      ctx.beginPath();
      ctx.arc(x, y, (own ? 7 : 5) * ratio, 0, 2 * Math.PI);
      ctx.fill();
      if (own) {
        ctx.strokeStyle = "#1a202c";
        ctx.lineWidth = 2 * ratio;
        ctx.beginPath();
        ctx.arc(x, y, 11 * ratio, 0, 2 * Math.PI);
        ctx.stroke();
      }
      ctx.globalAlpha = 1;
      if (q.mark) {
        ctx.fillStyle = "#1a202c";
        ctx.font = `${12 * ratio}px system-ui`;
        const late = x > p.bbox.left + 0.8 * p.bbox.width;
        ctx.textAlign = late ? "right" : "left";
        ctx.fillText(q.mark, x + (late ? -10 : 10) * ratio, y - 8 * ratio);
      }
    });
    ctx.restore();
  }

  u.over.addEventListener("click", (e) => {
    const box = u.over.getBoundingClientRect(),
      x = e.clientX - box.left,
      y = e.clientY - box.top;
    let best = null,
      least = 900;
    points.forEach((p) => {
      const away = (u.valToPos(p.x, "x") - x) ** 2 + (u.valToPos(p.y, "y") - y) ** 2;
      if (away < least) {
        least = away;
        best = p;
      }
    });
    if (best) choose(motions[best.motion]);
  });
  return {
    show(motion) {
      focus = motion;
      u.redraw(false);
    },
    u,
  };
}
