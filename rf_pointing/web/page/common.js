// What the pages of an antenna and of a network share: connection, token, commands.
// Every text from a station becomes textContent: a name can never become markup.
"use strict";

const STALE_S = 2.0;       // older values are grey
const LOST_S = 1.5;        // without a message the connection is lost
const CONFIRM_S = 4.0;
const SVG = "http://www.w3.org/2000/svg";
const LEVELS = [["good", "● ok"], ["warn", "▲ warning"], ["bad", "✖ error"], ["bad fault", "■ FAULT"]];
const STATES = {waiting: "○ waiting", active: "▶ active", tracked: "● tracked", lost: "✖ lost", missed: "✖ missed",
  skipped: "– skipped", yields: "– yields", weather: "☂ weather"};

const byId = (id) => document.getElementById(id);
const shown = {};          // newest sections
let token = sessionStorage.getItem("token") || "";
let received = 0, socket = null, retry = 300;
const BASE = location.pathname.replace(/[^/]*$/, "");   // "/", or "/at/gs1/" in a network

function write(id, text) {
  const node = id instanceof Element ? id : byId(id);
  if (node.textContent !== text) node.textContent = text;
}

function make(tag, attributes, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) node.setAttribute(name, value);
  node.append(...children.filter((each) => each !== null && each !== undefined));
  return node;
}

function draw(tag, attributes, text) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  if (text !== undefined) node.textContent = text;
  return node;
}

// Rows are made anew only when they change, and the keyboard stays where it was.
function refill(parent, data, rows) {
  const text = JSON.stringify(data);
  if (refill.made.get(parent) === text) return;
  refill.made.set(parent, text);
  const key = parent.contains(document.activeElement) ? document.activeElement.dataset.key : undefined;
  parent.replaceChildren(...rows());
  if (key !== undefined) [...parent.querySelectorAll("[data-key]")].find((each) => each.dataset.key === key)?.focus();
}
refill.made = new WeakMap();

const words = (name) => (name || "").replaceAll("_", " ");
const fixed = (value, digits) => Number.isFinite(value) ? value.toFixed(digits).replace("-", "−") : "–";
const mark = (level) => make("span", {class: `mark ${LEVELS[level][0]}`}, LEVELS[level][1]);
const clock = (utc) => (utc || "").slice(11, 19);
const seconds = (utc) => Date.parse(utc) / 1000;

function span(s) {
  const all = Math.max(0, Math.round(s)), h = Math.floor(all / 3600);
  const rest = [Math.floor(all / 60) % 60, all % 60].map((each) => String(each).padStart(2, "0"));
  return (h ? [h, ...rest] : rest).join(":");
}

// Connection

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${BASE}live`);
  socket.onmessage = (event) => {
    received = performance.now();
    retry = 300;
    const sections = JSON.parse(event.data);
    Object.assign(shown, sections);
    setLink("live");
    for (const name of Object.keys(sections)) if (show[name]) show[name](sections[name]);
  };
  socket.onclose = () => {
    setTimeout(connect, retry);
    retry = Math.min(2 * retry, 3000);
  };
}

function setLink(state) {
  if (document.body.dataset.link === state) return;
  document.body.dataset.link = state;
  if (state === "live") byId("banner").hidden = true;
}

function watch() {
  const silent = (performance.now() - received) / 1000;
  if (received && silent > LOST_S) {
    setLink("lost");
    write("banner", `CONNECTION LOST. What you see is ${span(silent)} old. The antenna may be moving.`);
    byId("banner").hidden = false;
    write("link", `No connection, ${span(silent)}`);
  } else if (!received && performance.now() > 3000) {
    write("banner", "NO CONNECTION to the station. Nothing is shown.");
    byId("banner").hidden = false;
    write("link", "No connection");
  } else if (received) {
    write("link", "● Live");
  }
}

// Commands

function toast(text, good) {
  const node = byId("toast");
  node.dataset.good = good;
  node.textContent = text;
  node.hidden = false;
  clearTimeout(toast.timer);
  toast.timer = setTimeout(() => { node.hidden = true; }, good ? 4000 : 10000);
}

async function command(name, args, quiet, base) {
  if (!token) {
    toast(`NOT SENT: ${words(name)} needs the token. Unlock the commands first.`, false);
    byId("door").showModal();
    return null;
  }
  try {
    const response = await fetch(`${base || BASE}command`, {method: "POST", body: JSON.stringify({name, arguments: args || {}}),
      headers: {"Content-Type": "application/json", "Authorization": `Bearer ${token}`}});
    const answer = await response.json();
    if (response.status === 401) setToken("");
    if (!quiet || !answer.accepted) toast(`${words(name)}: ${answer.message}`, answer.accepted);
    return answer;
  } catch (error) {
    toast(`NOT SENT: ${words(name)}: no connection to the station`, false);
    return null;
  }
}

function setToken(given) {
  token = given;
  sessionStorage.setItem("token", given);
  write("unlock", token ? "Lock commands" : "Unlock commands");
}

async function unlock() {
  const given = byId("token").value.trim();
  if (!/^[!-~]+$/.test(given)) {
    write("door-message", "The token is a line of plain letters, digits and signs.");
    return;
  }
  token = given;
  const answer = await command("unlock");
  setToken(answer && answer.accepted ? given : "");
  byId("token").value = "";
  if (token) byId("door").close();
  write("door-message", token ? "" : answer ? answer.message : "No connection to the station.");
}

// A motion begins with the second press: one touch on a telephone must not move an antenna.
function press(button, name, args) {
  if (button.hasAttribute("data-confirm") && !button.classList.contains("armed")) {
    const text = button.textContent;
    button.classList.add("armed");
    button.textContent = `${text}: press again`;
    setTimeout(() => { button.classList.remove("armed"); button.textContent = text; }, CONFIRM_S * 1000);
    return;
  }
  command(name, args);
}

// With the script of the page complete: what arrives needs it.
function begin() {
  setToken(token);
  byId("unlock").addEventListener("click", () => token ? setToken("") : byId("door").showModal());
  byId("door-open").addEventListener("click", unlock);
  byId("door-close").addEventListener("click", () => byId("door").close());
  byId("token").addEventListener("keydown", (event) => { if (event.key === "Enter") unlock(); });
  connect();
  setInterval(watch, 250);
}
