// Whether the browser starts and draws a page: where it does not, that says nothing about the view.

import { closeBrowser, theBrowser } from "./harness.mjs";

try {
  const page = await (await theBrowser()).newPage();
  await page.setContent("<p>drawn</p>");
  await page.screenshot();
  await closeBrowser();
  process.exit(0);
} catch (error) {
  console.error(String(error));
  process.exit(1);
}
