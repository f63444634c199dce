// The page of a network: a line for each antenna, the worst first; alarms once; the plan of the day.
"use strict";

const PLAN_H = [-2, 22], COMING = 12;
const LEVEL_NAMES = ["ok", "warning", "error", "fault"];
const made = {lines: new Map(), plan: new Map()};   // rows by antenna: a press on one must not lose it

const page = (antenna) => `/at${antenna}/`;
const short = (antenna) => antenna.slice(1);
const share = (s) => 100 * (s / 3600 - PLAN_H[0]) / (PLAN_H[1] - PLAN_H[0]);

function rowsOf(table, parent, antennas, build) {
  for (const each of antennas) if (!table.has(each)) table.set(each, build(each));
  const rows = antennas.map((each) => table.get(each));
  if (rows.some((row, place) => parent.children[place] !== row) || parent.children.length !== rows.length) {
    const focus = parent.contains(document.activeElement) ? document.activeElement : null;
    parent.replaceChildren(...rows);
    if (focus) focus.focus();
  }
  return rows;
}

function nextText(next) {
  if (next.text) return next.text;
  return "left_s" in next ? `${next.target}, ${span(next.left_s)} left` : `${next.target} in ${span(next.in_s)}`;
}

function showLine(row, line) {
  const [name, state, ...rest] = row.cells, mode = words(line.pointing || line.mode) || "–";
  row.className = `level-${line.level}`;
  write(name.querySelector("a"), line.name || short(line.antenna));
  write(name.querySelector("small"), short(line.antenna));
  refill(state, [line.level, line.worst, line.more], () => [mark(line.level), ` ${line.worst} `,
    line.more.length ? make("small", {title: line.more.join("\n")}, `and ${line.more.length} more`) : ""]);
  const texts = [mode, line.target || "–", line.beamwidths === null ? "–" : `${line.beamwidths > 99 ? ">99" : fixed(line.beamwidths, 2)} beam`,
    line.carrier === null ? "–" : `${fixed(line.carrier, 1)} dB-Hz`, nextText(line.next)];
  rest.forEach((cell, place) => {
    write(cell, texts[place]);
    cell.className = texts[place] === "–" ? "nothing" : "";
  });
}

function drawPlan(lines) {
  const order = [...lines].sort((a, b) => a.antenna.localeCompare(b.antenna, undefined, {numeric: true}));
  const rows = rowsOf(made.plan, byId("plan"), order.map((line) => line.antenna), (antenna) => make("div", {class: "lane"},
    make("a", {href: page(antenna)}, short(antenna)), draw("svg", {viewBox: "0 0 100 10", preserveAspectRatio: "none", role: "img"})));
  rows.forEach((row, place) => {
    const plan = order[place].plan, svg = row.querySelector("svg");
    refill(svg, plan.map((each) => [each.target, each.state, Math.floor(each.begin_s / 60)]), () => [
      ...plan.map((each) => {
        const begin = Math.max(0, share(each.begin_s)), state = each.state in STATES ? each.state : "waiting";
        // Not by the colour alone: what came to nothing is low.
        const low = !["waiting", "active", "standby", "tracked"].includes(each.state);
        const box = draw("rect", {class: `slot slot-${state}`, x: begin, y: low ? 5 : 1, height: low ? 4 : 8, width: Math.max(0.3, Math.min(100, share(each.end_s)) - begin)});
        box.append(draw("title", {}, `${each.target} ${each.state}`));
        return box;
      }), draw("path", {class: "moment", d: `M${share(0)} 0V10`})]);
    svg.setAttribute("aria-label", `Plan of ${short(order[place].antenna)}: ${plan.map((each) => `${each.target} ${each.state}`).join(", ").slice(0, 300) || "no pass"}`);
  });
}

function drawHours(utc) {
  const now = seconds(utc), hours = [];
  const first = Math.ceil((now / 3600 + PLAN_H[0]) / 3) * 3;
  for (let hour = first; hour <= now / 3600 + PLAN_H[1]; hour += 3) hours.push(hour);
  const place = document.querySelector(".hours");
  refill(place, hours, () => hours.map((hour) => make("span", {}, `${String(hour % 24).padStart(2, "0")}:00`)));
  // A style attribute would be refused by the page's own policy; a property is not.
  hours.forEach((hour, number) => { place.children[number].style.left = `${share(3600 * hour - now)}%`; });
}

function drawComing(lines) {
  const rows = lines.flatMap((line) => line.plan.filter((each) => each.end_s > 0 && ["waiting", "active", "standby"].includes(each.state))
    .map((each) => ({...each, antenna: line.antenna}))).sort((a, b) => a.begin_s - b.begin_s).slice(0, COMING);
  refill(byId("coming"), rows, () => rows.length ? rows.map((row) => make("li", {}, make("strong", {class: "number"}, row.begin_s > 0 ? `in ${span(row.begin_s)}` : `${span(row.end_s)} left`),
    make("span", {class: "grow"}, row.target), make("span", {}, short(row.antenna)), row.state === "waiting" ? null : make("span", {}, STATES[row.state] || row.state))) : [make("li", {}, "No antenna has a plan.")]);
}

async function acknowledge(alarm) {
  // One after the other: the server answers eight at a time, and a stop must find room.
  for (const antenna of alarm.open) {
    const answer = await command("night_acknowledge", {name: alarm.name}, true, page(antenna));
    if (!answer) return;
    toast(`${short(antenna)}: ${answer.message}`, answer.accepted);
  }
}

const show = {
  utc(utc) {
    write("clock", clock(utc));
    write("date", utc.slice(0, 10));
    drawHours(utc);
  },
  lines(lines) {
    const body = byId("lines").tBodies[0];
    const rows = rowsOf(made.lines, body, lines.map((line) => line.antenna), (antenna) => make("tr", {},
      make("td", {}, make("a", {href: page(antenna)}), " ", make("small", {})), ...Array.from({length: 6}, () => make("td", {}))));
    rows.forEach((row, place) => showLine(row, lines[place]));
    const counts = LEVEL_NAMES.map((name, level) => [name, lines.filter((line) => line.level === level).length]).reverse();
    write("summary", lines.length ? counts.filter(([, count]) => count).map(([name, count]) => `${count} ${name}`).join(", ") : "none found yet");
    document.title = lines.some((line) => line.level > 1) ? `✖ ${lines.filter((line) => line.level > 1).length} of ${lines.length} antennas` : `● ${lines.length} antennas`;
    drawPlan(lines);
    drawComing(lines);
  },
  alarms(alarms) {
    const open = alarms.filter((each) => each.open.length).length;
    write("alarm-count", alarms.length ? `(${open} of ${alarms.length} not acknowledged)` : "");
    refill(byId("alarms"), alarms, () => !alarms.length ? [make("li", {class: "good"}, "● no alarm")] : alarms.map((alarm) => {
      const button = make("button", {type: "button", "data-key": alarm.name, "aria-label": `Acknowledge ${alarm.name} at ${alarm.open.map(short).join(", ")}`}, "Acknowledge");
      button.addEventListener("click", () => acknowledge(alarm));
      const at = Object.keys(alarm.messages).flatMap((antenna) => [make("a", {href: page(antenna), title: alarm.messages[antenna]}, short(antenna)), " "]);
      return make("li", {}, mark(Math.min(alarm.level, 2)), make("span", {class: "grow"}, make("strong", {}, words(alarm.name)), ` ${alarm.message} `,
        alarm.raised_utc ? make("small", {}, `since ${clock(alarm.raised_utc)} `) : "", make("span", {class: "at"}, "at ", ...at)),
        alarm.open.length ? button : make("span", {}, "✔ acknowledged"));
    }));
  },
};

document.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !byId("door").open) toast("NOTHING STOPPED: Esc stops an antenna on its own page. Open it first.", false);
});
begin();
