// node open.mjs PAGE FILE PICTURE WORD...: open the built page in Chromium, give it the file and wait for the words.
// Prints the text that a reader sees and the number of canvases.
import puppeteer from 'puppeteer-core';

const [page, file, picture, ...words] = process.argv.slice(2);
// Labels of axes are drawn, so they are no inner text.
const visible = () =>
  [document.body.innerText, ...[...document.querySelectorAll('svg text')].map((text) => text.textContent)].join(' ');
const browser = await puppeteer.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  headless: true,
  args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
try {
  const tab = await browser.newPage();
  await tab.setViewport({ width: 1400, height: 850 });
  tab.on('pageerror', (error) => console.error(`page error: ${error}`));
  await tab.goto(`file://${page}`, { waitUntil: 'load' });
  await (await tab.waitForSelector('input[type=file]')).uploadFile(file);
  let seen = '';
  for (const until = Date.now() + 60000; Date.now() < until && !words.every((word) => seen.includes(word)); ) {
    await new Promise((resolve) => setTimeout(resolve, 200));
    seen = (await tab.evaluate(visible)).replace(/\s+/g, ' ');
  }
  await new Promise((resolve) => setTimeout(resolve, 500)); // the last frame
  await tab.screenshot({ path: picture });
  const canvases = await tab.evaluate(() => document.querySelectorAll('canvas').length);
  console.log(JSON.stringify({ seen, canvases }));
} finally {
  await browser.close();
}
