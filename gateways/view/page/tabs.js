// States, plots, events and robots: side by side where there is room, else one at a time under tabs. Who presses the tab that is open
// closes it, and the map has its place.

import { byId, make, setAttribute, setHidden, setText } from "./dom.js";
import { mark } from "./format.js";

const PANELS = { state: "State", plots: "Plots", events: "Events", robots: "Robots" };

let shown = "state";
/** On a short screen the map goes first. */
let isOpen = matchMedia("(min-height: 43em)").matches;
/** As in the style sheet. */
const wide = matchMedia("(min-width: 60em) and (min-height: 40em)");

export function build() {
  for (const [id, name] of Object.entries(PANELS)) {
    byId("tabs").append(make("button", { type: "button", role: "tab", id: `tab-${id}`, "aria-controls": id, onclick: () => show(id, !isOpen || id !== shown) }, name));
  }
  byId("tabs").addEventListener("keydown", (event) => {
    const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!way) return;
    const ids = Object.keys(PANELS);
    show(ids[(ids.indexOf(shown) + way + ids.length) % ids.length], true);
    byId(`tab-${shown}`).focus();
  });
  wide.addEventListener("change", arrange);
  arrange();
}

/** @param {string} id @param {boolean} opens */
function show(id, opens) {
  [shown, isOpen] = [id, opens];
  arrange();
}

function arrange() {
  const tabbed = !wide.matches;
  setHidden(byId("tabs"), !tabbed);
  setAttribute(byId("tabs"), "role", tabbed ? "tablist" : null);
  setAttribute(byId("tabs"), "aria-label", tabbed ? "Panels" : null);
  for (const id of Object.keys(PANELS)) {
    setHidden(byId(id), tabbed && (id !== shown || !isOpen));
    setAttribute(byId(id), "role", tabbed ? "tabpanel" : null);
    setAttribute(byId(id), "aria-labelledby", tabbed ? `tab-${id}` : `${id}-title`);
    setAttribute(byId(`tab-${id}`), "aria-selected", String(id === shown && isOpen));
    setAttribute(byId(`tab-${id}`), "tabindex", id === shown ? "0" : "-1");
  }
}

/** The tabs show what lies behind them. @param {import("./model.js").Model} model @param {boolean} isWarned whether a state is to be watched */
export function flag(model, isWarned) {
  setText(byId("tab-state"), isWarned ? `State ${mark("warning")}` : "State");
  const worst = ["alarm", "warning"].find((severity) => model.robots.some((line) => line.severity === severity && line.robot !== model.chosen));
  setText(byId("tab-robots"), worst ? `Robots ${mark(worst)}` : "Robots");
  const own = model.alarms[0]?.severity;
  setText(byId("tab-events"), own === "alarm" || own === "warning" ? `Events ${mark(own)}` : "Events");
}
