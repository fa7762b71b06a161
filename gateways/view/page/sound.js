// A tone and a shake when an alarm begins, where the browser and the user allow them. A browser gives no tone before the page was touched.

import { recall, remember } from "./dom.js";

/** Tones one after the other, Hz, and shakes, ms on and off. */
const SIGNALS = { alarm: { tones: [880, 660, 880, 660], shakes: [300, 100, 300, 100, 300] }, warning: { tones: [660, 660], shakes: [200, 150, 200] } };
const TONE_S = 0.16;

/** @type {AudioContext|null} */ let audio = null;
let isOn = true;

export function build() {
  isOn = recall("local", "sound") !== "off";
  for (const event of ["pointerdown", "keydown"]) addEventListener(event, unlock);
}

export function on() {
  return isOn;
}

export function toggle() {
  isOn = !isOn;
  remember("local", "sound", isOn ? "on" : "off");
  if (isOn) play("warning");
}

function unlock() {
  if (!isOn || typeof AudioContext === "undefined") return;
  audio ??= new AudioContext();
  if (audio.state === "suspended") audio.resume().catch(() => {});
}

/** @param {"alarm"|"warning"} severity */
export function play(severity) {
  if (!isOn) return;
  const { tones, shakes } = SIGNALS[severity];
  // A browser that has not been touched yet refuses, and says so in its console.
  if (navigator.userActivation?.hasBeenActive) navigator.vibrate?.(shakes);
  if (audio?.state !== "running") return;
  tones.forEach((frequency, index) => {
    const begin = /** @type {AudioContext} */ (audio).currentTime + index * (TONE_S + 0.04);
    const [tone, volume] = [new OscillatorNode(/** @type {any} */ (audio), { frequency }), new GainNode(/** @type {any} */ (audio), { gain: 0 })];
    volume.gain.setValueAtTime(0.25, begin);
    volume.gain.linearRampToValueAtTime(0, begin + TONE_S);
    tone.connect(volume).connect(/** @type {AudioContext} */ (audio).destination);
    tone.start(begin);
    tone.stop(begin + TONE_S);
  });
}
