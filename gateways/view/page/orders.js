// The orders that this page has given, and what became of each. Pure. Nothing waits here to be sent later.

/** @typedef {import("./protocol.d.ts").OrderKind} OrderKind */
/** @typedef {{order: string, robot: number, kind: OrderKind, stage: string, text: string, final: boolean, given: number,
 *    changed: number, believed?: {stage: string, text: string}|null}} Entry times are of performance.now(); `believed`: as it was when contact was lost */

/** Most orders that are kept; the oldest goes. */
const KEPT = 20;
/** The same order within this time is a double click. */
const DOUBLE_MS = 700;
/** A final report stays so long; what went wrong stays longer. */
const SHOWN_MS = { good: 10000, bad: 30000 };

/** Names as they are read. @type {Record<OrderKind, string>} */
export const NAMES = { hold: "Hold", land: "Land", goto: "Go to", takeoff: "Take-off", start: "Start", stop: "Stop" };

export class OrderBook {
  /** The newest first. @type {Entry[]} */
  entries = [];

  /**
   * Gives an order. The answer is the message to send now; null if the order cannot be sent; it is not sent later either.
   * @param {OrderKind} kind @param {number} robot
   * @param {{order: string, live: boolean, seen: number|null, at: number, position?: [number, number]|null,
   *    altitude_m?: number|null, confirm?: string|null}} how
   */
  give(kind, robot, how) {
    const { order, at } = how;
    const same = this.entries.find((entry) => entry.kind === kind && entry.robot === robot);
    if (same && at - same.given < DOUBLE_MS && same.stage !== "not-sent") return null;
    const entry = { order, robot, kind, stage: "given", text: "no answer yet", final: false, given: at, changed: at };
    this.entries.unshift(entry);
    this.entries.length = Math.min(this.entries.length, KEPT);
    if (!how.live) {
      this.notSent(order, at);
      return null;
    }
    return {
      type: "order", order, robot, kind, seen: how.seen ?? 0,
      position: how.position ?? null, altitude_m: how.altitude_m ?? null, confirm: how.confirm ?? null,
    };
  }

  /** It was not sent: the socket did not take it, or this page may not order. @param {string} order @param {number} at @param {string} [why] */
  notSent(order, at, why = "no contact") {
    this.#change(order, { stage: "not-sent", text: `${why}; it will not be sent later`, final: true, changed: at });
  }

  /** There is no contact: what becomes of what goes on is not known. */
  doubt() {
    for (const entry of this.entries) {
      if (entry.final || entry.believed) continue;
      entry.believed = { stage: entry.stage, text: entry.text };
      Object.assign(entry, { stage: "unknown", text: "no contact; see what the robot does" });
    }
  }

  /** There is contact again, over the same connection: no report was missed. */
  trust() {
    for (const entry of this.entries) {
      if (entry.believed) Object.assign(entry, entry.believed, { believed: null });
    }
  }

  /** Takes a report; also of an order that was given before this page was loaded. @param {import("./protocol.d.ts").OrderReport} report @param {number} at */
  report(report, at) {
    const { order, robot, kind, stage, text, final } = report;
    if (!this.#change(order, { stage, text, final, changed: at })) {
      // It was not given here: a press that follows is no double click.
      this.entries.unshift({ order, robot, kind, stage, text, final, given: -Infinity, changed: at });
      this.entries.length = Math.min(this.entries.length, KEPT);
    }
  }

  /** No reports come of what goes on, for this reason. Those that come again say how it goes on. @param {string} why @param {number} at */
  unheard(why, at) {
    for (const entry of this.entries) {
      if (!entry.final) Object.assign(entry, { stage: "unknown", text: `${why}; see what the robot does`, final: true, changed: at, believed: null });
    }
  }

  /** What is shown: what goes on, and what ended a short while ago. @param {number} at */
  shown(at) {
    return this.entries.filter((entry) => {
      if (!entry.final) return true;
      return at - entry.changed < (entry.stage === "done" ? SHOWN_MS.good : SHOWN_MS.bad);
    });
  }

  /** @param {string} order @param {Partial<Entry>} change */
  #change(order, change) {
    const entry = this.entries.find((known) => known.order === order);
    // A final report is the last word; one that comes later is an echo. What became of an unknown one can still be told.
    if (entry && (!entry.final || entry.stage === "unknown")) Object.assign(entry, change, { believed: null });
    return entry !== undefined;
  }
}

/** The severity of a stage. @param {string} stage @returns {import("./protocol.d.ts").Severity} */
export function severityOf(stage) {
  if (stage === "not-sent" || stage === "refused" || stage === "aborted") return "alarm";
  if (stage === "replaced" || stage === "unknown") return "warning";
  return stage === "done" ? "ok" : "order";
}

/** A stage in words. @param {string} stage */
export function stageWords(stage) {
  return { given: "WAITING", "not-sent": "NOT SENT", "in-progress": "IN PROGRESS" }[stage] ?? stage.toUpperCase();
}
