// Where this phone is, on the map, while the user wants that. The place stays in the browser: nothing of it is sent.

import { byId, setAttribute, setHidden } from "./dom.js";
import * as map from "./map.js";

/** A place that is older than this is shown no more, ms. */
const OLD_MS = 30000;

/** @type {number|null} */ let watched = null;
/** @type {any} */ let timer = 0;

export function build() {
  // Browsers tell it to pages over HTTPS, and to those of this computer, alone.
  setHidden(byId("own"), !isSecureContext || !("geolocation" in navigator));
  byId("own").addEventListener("click", () => (watched === null ? begin() : end()));
}

function begin() {
  setAttribute(byId("own"), "aria-pressed", "true");
  watched = navigator.geolocation.watchPosition(({ coords: { latitude, longitude, accuracy } }) => {
    map.setOwn({ place: [latitude, longitude], accuracy_m: accuracy });
    clearTimeout(timer);
    timer = setTimeout(() => map.setOwn(null), OLD_MS);
  }, end, { enableHighAccuracy: true, maximumAge: 5000 });
}

function end() {
  if (watched !== null) navigator.geolocation.clearWatch(watched);
  watched = null;
  clearTimeout(timer);
  map.setOwn(null);
  setAttribute(byId("own"), "aria-pressed", "false");
}
