// The page of one antenna.
"use strict";

const STRIP_S = 120.0;
const TRAIL = 60;
let strip = [], trail = [];

// The antenna stops 0.5 s after the last call: what is not sent, or comes late, ends the jog.
const JOG_MS = 150;

function jogRates(directions) {
  const live = shown.live || {}, limits = live.rate_limit_deg_s || [0, 0], beam = live.beamwidth_deg || 0;
  return directions.map((direction, axis) => {
    const slow = Math.min(0.1 * limits[axis], beam > 0 ? 0.25 * beam : Infinity);
    return direction * (byId("jog-fast").checked ? 0.5 * limits[axis] : slow) * Math.PI / 180;
  });
}

function jog(directions) {
  if (jog.timer) return;
  const [azimuth, elevation] = jogRates(directions);
  const send = async () => {
    // One at a time: calls that wait behind a slow link would move the antenna later.
    if (jog.sent) return;
    jog.sent = true;
    const answer = await command("jog", {azimuth, elevation}, true);
    jog.sent = false;
    if (!answer || !answer.accepted) endJog();
  };
  jog.timer = setInterval(send, JOG_MS);
  send();
}

function endJog() {
  if (!jog.timer) return;
  clearInterval(jog.timer);
  jog.timer = null;
  command("jog", {azimuth: 0, elevation: 0}, true);
}

function submit(id, name, read) {
  byId(id).addEventListener("submit", (event) => {
    event.preventDefault();
    command(name, read(new FormData(event.target)));
  });
}

// The sky

function place(azimuth, elevation) {
  const over = elevation > 90;
  const a = (azimuth + (over ? 180 : 0)) * Math.PI / 180;
  const r = 90 - (over ? 180 - elevation : elevation);
  return [r * Math.sin(a), -r * Math.cos(a)];
}

const line = (points) => points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`).join("");

function ringAbout(azimuth, elevation, radius) {
  const [a, e, r] = [azimuth, elevation, radius].map((each) => each * Math.PI / 180), points = [];
  for (let turn = 0; turn <= 360; turn += 10) {
    const b = turn * Math.PI / 180;
    const z = Math.sin(e) * Math.cos(r) + Math.cos(e) * Math.sin(r) * Math.cos(b);
    const away = Math.atan2(Math.sin(b) * Math.sin(r) * Math.cos(e), Math.cos(r) - Math.sin(e) * z);
    points.push(place((a + away) * 180 / Math.PI, Math.max(0, Math.asin(z) * 180 / Math.PI)));
  }
  return line(points) + "Z";
}

function buildSky() {
  const sky = byId("sky");
  sky.append(draw("path", {id: "sky-mask", class: "mask", "fill-rule": "evenodd"}));
  for (const r of [30, 60]) {
    sky.append(draw("circle", {class: "ring", r}), draw("text", {x: r - 8, y: -5}, `${90 - r}°`));
  }
  sky.append(draw("path", {class: "ring", d: "M-90 0H90M0-90V90"}), draw("circle", {class: "sky-edge", r: 90}));
  for (const [text, a] of [["N", 0], ["30", 30], ["60", 60], ["E", 90], ["120", 120], ["150", 150], ["S", 180], ["210", 210],
    ["240", 240], ["W", 270], ["300", 300], ["330", 330]]) {
    const [x, y] = place(a, -10);
    sky.append(draw("text", {x, y, "font-weight": a % 90 ? 400 : 700}, text));
  }
  sky.append(draw("path", {id: "sky-zone", class: "zone"}), draw("circle", {id: "sky-sun", class: "sun", r: 4}),
    draw("path", {id: "sky-track", class: "track"}), draw("text", {id: "sky-aos"}), draw("text", {id: "sky-los"}),
    draw("path", {id: "sky-target", class: "target", d: "M0-6 6 0 0 6-6 0Z"}),
    draw("path", {id: "sky-beam", class: "beam", d: "M-7 0A7 7 0 1 0 7 0A7 7 0 1 0-7 0M-12 0H-4M4 0H12M0-12V-4M0 4V12"}));
  for (const id of ["sky-zone", "sky-sun", "sky-target", "sky-beam"]) byId(id).style.display = "none";
}

// Beside the end of a path, where neither the path nor a tick nor the label of the other end is.
function beside(way) {
  const [[x, y], [nextX, nextY]] = way, length = Math.hypot(nextX - x, nextY - y) || 1;
  const [dx, dy] = [(nextX - x) / length, (nextY - y) / length], side = x * dy - y * dx > 0 ? -1 : 1;
  const [labelX, labelY] = [x + side * 13 * dy - 7 * dx, y - side * 13 * dx - 7 * dy];
  const inside = Math.min(1, 82 / Math.max(1, Math.hypot(labelX, labelY)));
  return {x: labelX * inside, y: labelY * inside};
}

function put(id, position) {
  const visible = position && Number.isFinite(position[0]) && position[1] > -5 && position[1] < 185;
  byId(id).style.display = visible ? "" : "none";
  if (visible) byId(id).setAttribute("transform", `translate(${place(...position).map((each) => each.toFixed(2)).join(" ")})`);
  return visible;
}

// The beam

function buildBeam() {
  const beam = byId("beam");
  beam.append(draw("circle", {class: "ring", r: 100}), draw("circle", {class: "halfpower", r: 50}), draw("path", {class: "ring", d: "M-100 0H100M0-100V100"}),
    draw("text", {x: 0, y: 57}, "half power"), draw("text", {x: 0, y: 105}, "1 beamwidth"), draw("text", {x: 96, y: -6}, "right"), draw("text", {x: 14, y: -96}, "above"),
    draw("path", {id: "beam-trail", class: "trail"}), draw("path", {id: "beam-target", class: "target", d: "M0-7 7 0 0 7-7 0Z"}));
}

function showBeam(live) {
  const error = live.error_beamwidths || [], dot = byId("beam-target");
  const known = error.length === 2 && error.every(Number.isFinite) && !["", "idle"].includes(live.tracking || "");
  dot.style.display = known ? "" : "none";
  if (!known) {
    trail = [];
    write("error", "–");
    write("error-angle", "");
    write("held", live.tracking === "idle" ? "No pass is tracked." : "");
    byId("held").className = "words";
  } else {
    const size = Math.hypot(...error), scale = 100 * Math.min(1, 1 / Math.max(size, 1e-9));
    const [x, y] = [error[0] * (size > 1 ? scale : 100), -error[1] * (size > 1 ? scale : 100)];
    trail = [...trail.slice(1 - TRAIL), [x, y]];
    dot.setAttribute("transform", `translate(${x.toFixed(1)} ${y.toFixed(1)})`);
    write("error", size > 99 ? ">99" : fixed(size, size < 0.1 ? 3 : 2));
    const off = size * live.beamwidth_deg, width = `${fixed(live.beamwidth_deg, 3)}°`;
    // A Gaussian beam: half power is 3.01 dB at half a beamwidth.  A slew is told in degrees.
    write("error-angle", size > 1 ? `${fixed(off, 2)}° off a beam of ${width}`
      : `${fixed(off * 1000, 1)} mdeg of ${width}, ${fixed(12.04 * size * size, 2)} dB`);
    write("held", `${live.held ? "● held" : "✖ not held"}: ${live.on_source ? "axes on source" : `axes ${fixed(live.axis_distance_deg, 3)}° off`}`);
    byId("held").className = `words ${live.held ? "good" : "bad"}`;
  }
  byId("beam-trail").setAttribute("d", line(trail));
}

// Axes

function buildAxes() {
  for (const [index, name] of ["Azimuth", "Elevation"].entries()) {
    const svg = draw("svg", {viewBox: "0 0 300 46", preserveAspectRatio: "none", role: "img", "aria-label": name, id: `axis-${index}`});
    svg.append(draw("rect", {class: "bar", x: 10, y: 14, width: 280, height: 6}), draw("path", {class: "encoder", id: `axis-encoder-${index}`, d: "M0 20 6 32H-6Z"}),
      draw("path", {class: "command", id: `axis-command-${index}`, d: "M0 6V20"}), draw("rect", {class: "bar", x: 10, y: 38, width: 280, height: 5}),
      draw("rect", {class: "filled", id: `axis-rate-${index}`, x: 150, y: 38, width: 0, height: 5}));
    byId("axes").append(make("div", {class: "axis"}, make("p", {class: "figure"}, make("small", {id: `axis-name-${index}`}, `${name} `), make("span", {class: "number", id: `axis-now-${index}`}, "–"),
      make("small", {id: `axis-more-${index}`})), svg, make("p", {class: "ends"}, make("span", {id: `axis-low-${index}`}), make("span", {id: `axis-text-${index}`}), make("span", {id: `axis-high-${index}`}))));
  }
}

function showAxes(live) {
  const limits = (shown.station || {}).limits_deg, commanded = [live.azimuth_deg, live.elevation_deg];
  const names = (shown.station || {}).axes;
  for (const index of [0, 1]) {
    if (names) write(`axis-name-${index}`, `${names[index].replace("_", " ").replace(/^./, (first) => first.toUpperCase())} `);
    const now = (live.encoder_deg || [])[index], rate = (live.rate_deg_s || [])[index], most = (live.rate_limit_deg_s || [])[index];
    write(`axis-now-${index}`, `${fixed(now, 2)}°`);
    write(`axis-more-${index}`, ` → ${fixed(commanded[index], 2)}°`);
    write(`axis-text-${index}`, `rate ${fixed(rate, 2)} of ${fixed(most, 1)} deg/s${(live.at_limit || [])[index] ? " ▲ AT LIMIT" : ""}`);
    const width = Math.min(1, Math.abs(rate / most) || 0) * 140;
    byId(`axis-rate-${index}`).setAttribute("x", rate < 0 ? 150 - width : 150);
    byId(`axis-rate-${index}`).setAttribute("width", width);
    if (!limits || !Number.isFinite(limits[2 * index])) continue;
    const [low, high] = limits.slice(2 * index, 2 * index + 2);
    write(`axis-low-${index}`, `${fixed(low, 0)}°`);
    write(`axis-high-${index}`, `${fixed(high, 0)}°`);
    const at = (value) => 10 + 280 * Math.min(1, Math.max(0, (value - low) / (high - low) || 0));
    byId(`axis-encoder-${index}`).setAttribute("transform", `translate(${at(now).toFixed(2)} 0)`);
    byId(`axis-command-${index}`).setAttribute("transform", `translate(${at(commanded[index]).toFixed(2)} 0)`);
  }
}

// C/N0

function showCarrier(live) {
  const value = live.carrier_to_noise_db_hz, known = Number.isFinite(value) && value > 0 && (live.age_s.tracking ?? 99) < STALE_S;
  byId("carrier-card").classList.toggle("folded", !live.carrier_seen);
  byId("carrier").nextElementSibling.hidden = !known;
  write("carrier", known ? fixed(value, 1) : live.carrier_seen ? "no carrier" : "");
  const last = strip.length ? strip[strip.length - 1] : [-Infinity];
  if (live.t_s < last[0]) strip = [];
  if (live.t_s - last[0] < 0.4) return;
  strip = [...strip.filter((each) => each[0] > live.t_s - STRIP_S), [live.t_s, known ? value : null]];
  const values = strip.map((each) => each[1]).filter((each) => each !== null);
  const low = Math.floor((Math.min(...values) - 1) / 5) * 5, high = Math.ceil((Math.max(...values) + 1) / 5) * 5;
  let path = "", pen = false;
  for (const [t, each] of strip) {
    if (each !== null) path += `${pen ? "L" : "M"}${(300 + 300 * (t - live.t_s) / STRIP_S).toFixed(1)} ${(88 - 86 * (each - low) / (high - low)).toFixed(1)}`;
    pen = each !== null;
  }
  byId("strip").replaceChildren(draw("path", {class: "signal", d: path}));
  write("strip-range", values.length ? `${low} to ${high} dB-Hz` : "");
}

// Sections

function countdown(live) {
  const busy = !["", "idle", undefined].includes(live.tracking), path = shown.path, executive = shown.executive;
  if (busy && live.los_s > live.t_s) return ["Loss of signal in", span(live.los_s - live.t_s)];
  if (executive && executive.state !== "idle" && executive.next_s > live.t_s) {
    const next = (shown.schedule || []).find((row) => row.id === executive.next);
    return [`Next pass (${(next ? next.target : executive.next).slice(0, 40)}) in`, span(executive.next_s - live.t_s)];
  }
  if (path && path.aos_s > live.t_s) return ["Acquisition in", span(path.aos_s - live.t_s)];
  if (path && path.los_s > live.t_s) return ["Above the horizon for", span(path.los_s - live.t_s)];
  return ["Countdown", "no pass"];
}

function showAges(ages) {
  for (const section of document.querySelectorAll("[data-source]")) {
    const age = ages[section.dataset.source], stale = !(age <= (section.dataset.source === "executive" ? 6 : STALE_S));
    section.classList.toggle("stale", stale);
    if (stale) section.querySelector("h2").dataset.age = age === undefined ? "never received" : `${span(age)} old`;
  }
}

const show = {
  live(live) {
    showAges(live.age_s);
    const utc = live.utc || "";
    write("clock", clock(utc) || "--:--:--");
    write("date", utc.slice(0, 10));
    write("antenna-mode", words(live.antenna) || "no antenna");
    write("tracking-mode", "tracking" in live.age_s ? words(live.tracking) || "–" : "no controller");
    write("target", live.target || (live.sky_target || {}).name || "none");
    const [what, left] = countdown(live);
    write("countdown-what", what);
    write("countdown", left);
    write("reason", live.reason ? `Why: ${live.reason}` : "");
    write("warnings", [live.alarm && `▲ ${live.alarm}`, live.warning && `▲ ${live.warning}`, live.high_wind && `▲ wind: ${live.high_wind}`,
      live.sun_permitted && `☀ ${live.sun_permitted}`,
      live.transmit_inhibit && `○ transmitter off: ${live.transmit_inhibit}`].filter(Boolean).join("  "));
    byId("warnings").className = `words ${live.level === 2 ? "bad" : "warn"}`;
    byId("fault").hidden = !live.fault;
    write("fault", live.fault ? `FAULT LATCHED: ${live.fault}. Look at the antenna, then reset the fault.` : "");
    put("sky-beam", live.sky_deg || live.encoder_deg);
    const up = put("sky-target", "target" in live.age_s && live.age_s.target < STALE_S ? (live.sky_target || {}).position_deg : null);
    showBeam(live);
    showAxes(live);
    showCarrier(live);
    if (!show.spokenAt || performance.now() - show.spokenAt > 2000) {
      show.spokenAt = performance.now();
      const [a, e] = live.sky_deg || live.encoder_deg || [];
      byId("sky").setAttribute("aria-label", `Sky plot: beam at azimuth ${fixed(a, 1)}, elevation ${fixed(e, 1)} degrees; target ${up ? "above" : "below"} the horizon`);
    }
  },
  station(station) {
    write("station-name", station.name || "Station");
    write("station-more", `${station.band ? `${station.band} band, ` : ""}${station.namespace}`);
    document.title = station.name || "Station";
    if (station.mask_deg) {
      const edge = "M-90 0A90 90 0 1 0 90 0A90 90 0 1 0-90 0Z";
      byId("sky-mask").setAttribute("d", edge + line(station.mask_deg.map(([a, e]) => place(a, Math.max(0, e)))) + "Z");
    }
    const select = byId("sensor");
    if (station.sensors.join() !== [...select.options].map((each) => each.value).join()) {
      select.replaceChildren(...station.sensors.map((each) => make("option", {value: each}, each)));
      select.value = "auto";
    }
    write("offsets-now", station.offsets || "none");
  },
  sun(sun) {
    const up = sun && sun[1] > -1, radius = (shown.station || {}).sun_radius_deg;
    put("sky-sun", up ? sun : null);
    byId("sky-zone").style.display = up && radius > 0 ? "" : "none";
    if (up && radius > 0) byId("sky-zone").setAttribute("d", ringAbout(sun[0], sun[1], Math.max(radius, 5)));
    write("sun-zone", radius > 0 ? `Sun, zone ${radius}°` : "Sun");
  },
  path(path) {
    const points = path ? path.points_deg.map((each) => place(...each)) : [];
    byId("sky-track").setAttribute("d", line(points));
    const ends = [["sky-aos", "AOS", points], ["sky-los", "LOS", [...points].reverse()]];
    for (const [id, text, way] of ends) {
      write(id, way.length > 1 ? text : "");
      if (way.length < 2) continue;
      for (const [name, value] of Object.entries(beside(way))) byId(id).setAttribute(name, value.toFixed(1));
    }
  },
  certificate(given) {
    if (!given) return;
    const branch = given.chosen, rows = [["Pass", `${given.name}, peak ${fixed(given.sky_peak_deg, 1)}°`]];
    if (branch) {
      rows.push(["Branch", given.label], ["Start", `azimuth ${fixed(branch.start_deg[0], 1)}°`],
        ["Rates needed", branch.peak_rate_deg_s.map((each) => fixed(each, 2)).join(", ") + " deg/s"],
        ["Margins", `${fixed(branch.limit_margin_deg, 1)}° to ${branch.closest_limit}, mask ${fixed(branch.mask_margin_deg, 1)}°, Sun ${fixed(branch.sun_margin_deg, 1)}°`],
        ["Expected loss", `${fixed(branch.mean_loss_db, 2)} dB; ${fixed(branch.lost_s, 1)} s below half power`]);
      if (branch.late_s > 0) rows.push(["Late", `${fixed(branch.late_s, 0)} s after acquisition`]);
    }
    byId("certificate").replaceChildren(
      make("p", {}, make("span", {class: `mark ${given.accepted ? "good" : "bad"}`}, given.accepted ? "● accepted" : "✖ REFUSED"), ` ${given.refusal || ""}`),
      make("dl", {class: "facts"}, ...rows.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)])));
  },
  passes(passes) {
    refill(byId("passes"), passes, () => !passes.rows.length ? [make("li", {}, `no coming pass of ${passes.target}`)] : passes.rows.slice(0, 6).map((row) => {
      const button = make("button", {type: "button", "data-confirm": "", "data-key": row.aos_utc}, "Track");
      button.setAttribute("aria-label", `Track the pass of ${row.target} at ${clock(row.aos_utc)}`);
      button.addEventListener("click", () => press(button, "track", {aos_utc: row.aos_utc, sensor: byId("sensor").value || "auto"}));
      return make("li", {}, make("strong", {}, `${clock(row.aos_utc)}–${clock(row.los_utc)}`), make("span", {class: "grow"}, `${row.target}, ${fixed(row.peak_deg, 0)}° high`), button);
    }));
  },
  executive(executive) {
    write("night-state", executive.state);
    write("night-doing", [executive.target && `${executive.target}:`, ...executive.blocks, executive.doing].filter(Boolean).join("  "));
    const open = executive.alarms.filter((each) => !each.acknowledged).length;
    write("alarm-count", executive.alarms.length ? `(${open} of ${executive.alarms.length} not acknowledged)` : "");
    refill(byId("alarms"), executive.alarms, () => !executive.alarms.length ? [make("li", {class: "good"}, "● no alarm")] : executive.alarms.map((alarm) => {
      const button = make("button", {type: "button", "data-key": alarm.name}, "Acknowledge");
      button.addEventListener("click", () => command("night_acknowledge", {name: alarm.name}));
      return make("li", {}, mark(Math.min(alarm.level, 2)), make("span", {class: "grow"}, make("strong", {}, words(alarm.name)), ` ${alarm.message} `, make("small", {}, `since ${clock(alarm.raised_utc)}${alarm.count > 1 ? `, ${alarm.count} times` : ""}`)),
        alarm.acknowledged ? make("span", {}, "✔ acknowledged") : button);
    }));
  },
  schedule(rows) {
    refill(byId("schedule").tBodies[0], rows, () => rows.map((row) => make("tr", {}, make("td", {}, `${row.target} `, make("small", {}, row.id)), make("td", {}, `${clock(row.aos_utc)}–${clock(row.los_utc)}`),
      make("td", {}, `${fixed(row.peak_deg, 0)}°`), make("td", {}, STATES[row.state] || row.state), make("td", {}, make("div", {class: "reason", title: row.reason}, row.reason)))));
    const svg = byId("timeline"), times = rows.flatMap((row) => [seconds(row.aos_utc), seconds(row.los_utc)]).filter(Number.isFinite);
    if (!times.length) return svg.replaceChildren();
    const now = (shown.live || {}).t_s || times[0], begin = Math.min(...times, now) - 60, end = Math.max(...times, now) + 60;
    const at = (t) => 600 * (t - begin) / (end - begin);
    // Passes that overlap have two lanes.
    let lane = 0, busy = -Infinity;
    svg.replaceChildren(...rows.map((row) => {
      lane = seconds(row.aos_utc) < busy ? 1 - lane : 0;
      busy = Math.max(busy, seconds(row.los_utc));
      const box = draw("rect", {class: `slot slot-${row.state in STATES ? row.state : "waiting"}`, x: at(seconds(row.aos_utc)), y: 5 + 19 * lane, height: 17, width: Math.max(3, at(seconds(row.los_utc)) - at(seconds(row.aos_utc)))});
      box.append(draw("title", {}, `${row.target} ${row.state}`));
      return box;
    }), draw("path", {class: "moment", d: `M${at(now)} 0V46`}));
    svg.setAttribute("aria-label", `Timeline: ${rows.map((row) => `${row.target} ${row.state}`).join(", ").slice(0, 500)}`);
    write("night-begin", new Date(begin * 1000).toISOString().slice(11, 16));
    write("night-end", new Date(end * 1000).toISOString().slice(11, 16));
    show.timelineAt = now;
  },
  nodes(nodes) {
    const open = new Set([...document.querySelectorAll("#nodes details[open]")].map((each) => each.dataset.node));
    refill(byId("nodes"), nodes, () => nodes.map((node) => {
      const level = node.silent_s ? 2 : Math.max(0, ...node.checks.map((each) => Math.min(each[1], 2)));
      const worst = node.checks.filter((each) => each[1] > 0);
      const details = make("details", {"data-node": node.name}, make("summary", {"data-key": node.name}, mark(level), ` ${node.name} `, make("small", {}, node.silent_s ? `silent for ${node.silent_s} s` : worst.map((each) => each[2]).join("; "))),
        make("dl", {class: "facts"}, ...node.checks.flatMap(([name, , text]) => [make("dt", {}, name), make("dd", {}, text)])));
      details.open = open.has(node.name);
      return make("li", {}, details);
    }));
    if (!shown.executive) {
      write("night-state", "no executive runs");
      const own = (nodes.find((node) => node.name === "station_alarms" && !node.silent_s) || {checks: []}).checks.find((each) => each[0] === "alarms");
      refill(byId("alarms"), own, () => !own ? [make("li", {}, "Neither an executive nor station_alarms runs: nothing raises alarms. Errors are at the nodes.")]
        : own[2] === "none" ? [make("li", {class: "good"}, "● no alarm")] : [make("li", {}, mark(Math.min(own[1], 2)), make("span", {class: "grow"}, own[2]))]);
    }
  },
  reports(rows) {
    refill(byId("reports"), rows, () => !rows.length ? [make("li", {}, "none")] : rows.filter((row) => row.path.startsWith("/reports/")).map((row) => make("li", {}, make("a", {href: row.path, "data-key": row.path, target: "_blank", rel: "noopener"}, row.title),
      make("small", {}, `${row.kind}, ${new Date(row.utc_s * 1000).toISOString().slice(0, 16).replace("T", " ")} UTC`))));
  },
  events(rows) {
    if (rows.length) byId("events").replaceChildren(...rows.map((row) => make("li", {class: row.accepted ? "" : "bad"}, make("small", {}, row.utc.slice(11)), make("span", {class: "grow"}, `${row.accepted ? "●" : "✖"} ${row.text}`))));
  },
};

buildSky();
buildBeam();
buildAxes();
for (const button of document.querySelectorAll("[data-command]")) button.addEventListener("click", () => press(button, button.dataset.command, button.dataset.command === "night_skip" ? {name: ""} : {}));
byId("stop").addEventListener("click", () => command("stop_antenna"));
byId("offset").addEventListener("submit", (event) => {
  event.preventDefault();
  const data = new FormData(event.target);
  command(data.get("which"), {value: Number(data.get("value"))});
});
byId("offset-set").addEventListener("submit", (event) => {
  event.preventDefault();
  command(event.submitter.value, {name: new FormData(event.target).get("name").trim()});
});
for (const button of document.querySelectorAll("[data-jog]")) {
  const directions = button.dataset.jog.split(" ").map(Number);
  button.addEventListener("pointerdown", () => jog(directions));
  for (const end of ["pointerup", "pointerleave", "pointercancel", "keyup", "blur"]) button.addEventListener(end, endJog);
  button.addEventListener("keydown", (event) => {
    if ((event.key === " " || event.key === "Enter") && !event.repeat) jog(directions);
  });
  button.addEventListener("contextmenu", (event) => event.preventDefault());
}
document.addEventListener("visibilitychange", () => document.hidden && endJog());
window.addEventListener("blur", endJog);
submit("select", "select_target", (data) => ({target: data.get("target").trim()}));
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !byId("door").open && !event.repeat) command("stop_antenna");
});
byId("all").hidden = BASE === "/";
begin();
setInterval(() => { if (shown.schedule && shown.live && Math.abs(shown.live.t_s - (show.timelineAt || 0)) > 10) show.schedule(shown.schedule); }, 2000);
