// Writes a picture of a page as a PNG of 256 colours: a third of what the browser's own has, and text looks the same.

import { writeFileSync } from "node:fs";
import { crc32, deflateSync } from "node:zlib";

const COLOURS = 256;

/** @param {any} page @param {any} browser @param {string} path */
export async function picture(page, browser, path) {
  const shot = (await page.screenshot({ animations: "allow" })).toString("base64");
  // A page of its own reads the pixels: the one in the picture lets no data in.
  const reader = await browser.newPage();
  const { width, height, palette, indexes } = await reader.evaluate(reduce, { shot, most: COLOURS });
  await reader.close();
  const pixels = Buffer.from(indexes, "base64");
  const rows = Buffer.alloc((width + 1) * height);
  for (let y = 0; y < height; y += 1) pixels.copy(rows, y * (width + 1) + 1, y * width, (y + 1) * width);
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 3, 0, 0, 0], 8);
  const chunks = [["IHDR", head], ["PLTE", Buffer.from(palette)], ["IDAT", deflateSync(rows, { level: 9 })], ["IEND", Buffer.alloc(0)]];
  writeFileSync(path, Buffer.concat([Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]), ...chunks.map(([kind, data]) => chunk(kind, data))]));
}

function chunk(kind, data) {
  const whole = Buffer.concat([Buffer.alloc(4), Buffer.from(kind, "latin1"), data, Buffer.alloc(4)]);
  whole.writeUInt32BE(data.length, 0);
  whole.writeUInt32BE(crc32(whole.subarray(4, -4)), whole.length - 4);
  return whole;
}

/** In the browser: the most frequent colours, and for each pixel the nearest one of them. */
async function reduce({ shot, most }) {
  const image = new Image();
  image.src = `data:image/png;base64,${shot}`;
  await image.decode();
  const { width, height } = image;
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d");
  context.drawImage(image, 0, 0);
  const { data } = context.getImageData(0, 0, width, height);
  const colour = (at) => (data[at] << 16) | (data[at + 1] << 8) | data[at + 2];
  const counts = new Map();
  for (let at = 0; at < data.length; at += 4) counts.set(colour(at), (counts.get(colour(at)) ?? 0) + 1);
  const kept = [...counts].sort((a, b) => b[1] - a[1] || a[0] - b[0]).slice(0, most).map(([one]) => one);
  const parts = (one) => [one >> 16, (one >> 8) & 255, one & 255];
  const far = (a, b) => parts(a).reduce((sum, part, i) => sum + (part - parts(b)[i]) ** 2, 0);
  const nearest = new Map();
  for (const one of counts.keys()) nearest.set(one, kept.reduce((best, other, i) => (far(one, other) < far(one, kept[best]) ? i : best), 0));
  let text = "";
  for (let at = 0; at < data.length; at += 4) text += String.fromCharCode(nearest.get(colour(at)));
  return { width, height, palette: kept.flatMap(parts), indexes: btoa(text) };
}
