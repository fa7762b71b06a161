// The parts of a report that are words and tables. All texts may come from a damaged or hostile file: they become text, never markup.

import { byId, make, setHidden } from "../dom.js";
import { clock, compared, mark, moment } from "../format.js";

/** Most alarms that are named at the beginning. */
const WORST = 5;

/** @typedef {(event: number) => void} Jump */

/** @param {any} flight @param {Jump} jump */
export function build(flight, jump) {
  document.title = flight.title || "Flight";
  byId("title").textContent = flight.title || "Flight";
  byId("lead").append(...flight.lead.map((line) => make("p", {}, line)));
  summary(flight, jump);
  byId("over-time").append(...values(flight));
  events(flight, jump);
  requests(flight);
  recording(flight);
}

/** Links to the parts that the page has. @param {any} flight */
export function parts(flight) {
  const names = [["summary", "Summary"], ["track", "Track"], ...flight.plots.filter(({ curves }) => curves.length > 0).map(({ id, title }) => [`plot-${id}`, title]),
    ["events", "Events"], ["requests", "Requests"], ["recording", "Recording"]];
  const there = names.filter(([id]) => byId(id) && !byId(id).hidden);
  byId("parts").append(...there.map(([id, name]) => make("a", { href: `#${id}` }, name)));
}

/** A time that leads to the plots, with the playhead there. @param {any} flight @param {number} index of the event @param {Jump} jump @param {string} more */
function jumping(flight, index, jump, more = "") {
  return make("a", { class: "jump", href: "#over-time", "data-event": index, onclick: () => jump(index) }, moment(flight.events[index].at_s) + more);
}

/** @param {any} flight @param {Jump} jump */
function summary(flight, jump) {
  const box = byId("summary");
  box.append(...flight.summary.map((sentence) => make("p", {}, sentence)));
  const alarms = [...flight.events.keys()].filter((index) => flight.events[index].weight === "alarm");
  if (alarms.length > 0) {
    const worst = alarms.slice(0, WORST).map((index) => make("li", {}, `${mark("alarm")} `, jumping(flight, index, jump), ` ${flight.events[index].text}`));
    const more = alarms.length - worst.length;
    if (more > 0) worst.push(make("li", {}, make("a", { href: "#events" }, `${more} more alarms`)));
    box.append(make("ul", { class: "worst" }, ...worst));
  }
  if (flight.facts.length > 0) box.append(make("dl", { class: "facts" }, ...flight.facts.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value)))));
  if (flight.remarks.length > 0) box.append(make("ul", { class: "remarks" }, ...flight.remarks.map((remark) => make("li", {}, remark))));
}

/** @param {[string, string?][]} names each with its class */
const head = (names) => make("thead", {}, make("tr", {}, ...names.map(([name, kind]) => make("th", { scope: "col", class: kind ?? null }, name))));

/** @param {string} label @param {Node[]} children of a table that is broader than a phone */
const scrolled = (label, ...children) => make("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": label }, make("table", {}, ...children));

/** The values of the plots as a table: for those who do not see the plots, and for print. @param {any} flight */
function values(flight) {
  const rows = flight.plots.flatMap(({ title, unit, curves }) => curves.filter(({ kind }) => kind !== "bars").map(({ name, values }) => {
    const known = values.filter((value) => value !== null);
    const least = known.reduce((a, b) => Math.min(a, b));
    const greatest = known.reduce((a, b) => Math.max(a, b));
    const numbers = [least, greatest, known[0], known[known.length - 1]];
    return make("tr", {}, make("th", { scope: "row" }, `${title}: ${name}`), make("td", {}, unit), ...numbers.map((value) => make("td", { class: "number" }, compared(value))));
  }));
  if (rows.length === 0) return [];
  const columns = /** @type {[string, string?][]} */ ([["Value"], ["Unit"], ...["Least", "Greatest", "First", "Last"].map((name) => [name, "number"])]);
  return [make("details", {}, make("summary", {}, "The values as a table"), scrolled("Values of the plots", make("caption", {}, "Values of the plots"), head(columns), make("tbody", {}, ...rows)))];
}

/** @param {any} flight @param {Jump} jump */
function events(flight, jump) {
  const box = byId("events");
  if (flight.events.length === 0) box.append(make("p", {}, "The recording has none."));
  else {
    box.append(make("p", {}, "A time leads to the plots, where the playhead stands at it."));
    const hasClock = flight.start_unix_ms !== null;
    const rows = flight.events.map(({ at_s, weight, text }, index) => make("tr", { id: `event-${index + 1}` },
      make("td", { class: "number" }, String(index + 1)), make("td", { class: "time" }, jumping(flight, index, jump)),
      ...(hasClock ? [make("td", { class: "time spare" }, clock(flight.start_unix_ms + at_s * 1000, true))] : []),
      make("td", { class: "kind", "data-severity": weight }, `${mark(weight)} ${weight}`), make("td", {}, text)));
    const columns = /** @type {[string, string?][]} */ ([["#", "number"], ["Time"], ...(hasClock ? [["UTC", "spare"]] : []), ["Kind"], ["What happened"]]);
    box.append(make("table", {}, head(columns), make("tbody", {}, ...rows)));
  }
  if (flight.events_left_out > 0) box.append(make("p", {}, `Of kinds that came too often, ${flight.events_left_out} more events are not shown.`));
}

/** @param {any} flight */
function requests(flight) {
  if (flight.requests.length === 0) return;
  setHidden(byId("requests"), false);
  const rows = flight.requests.map(({ from_s, to_s, name, sender, outcome, reason }) => make("tr", {},
    make("td", { class: "time" }, moment(from_s)), make("td", {}, name), make("td", { class: "spare" }, sender),
    make("td", {}, make("span", { class: "kind", "data-outcome": outcome }, outcome), reason ? `: ${reason}` : ""),
    make("td", { class: "number spare" }, to_s === null ? "" : moment(Math.max(to_s - from_s, 0)))));
  byId("requests").append(make("table", {}, head([["Time"], ["Request"], ["Sender", "spare"], ["Outcome"], ["Took", "number spare"]]), make("tbody", {}, ...rows)));
}

/** What the recording says of itself. @param {any} flight */
function recording(flight) {
  const box = byId("recording");
  if (flight.metadata.length === 0) box.append(make("p", {}, "The recording has no metadata."));
  for (const { title, rows } of flight.metadata) {
    box.append(make("table", { class: "meta" }, make("caption", {}, title),
      make("tbody", {}, ...rows.map(([name, value]) => make("tr", {}, make("th", { scope: "row" }, name), make("td", {}, value))))));
  }
}

/** Marks the row of an event; null marks none. @param {number|null} index */
export function point(index) {
  document.querySelector("tr[aria-current]")?.removeAttribute("aria-current");
  if (index !== null) byId(`event-${index + 1}`)?.setAttribute("aria-current", "true");
}
