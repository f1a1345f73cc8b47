// Drives a report in headless Chromium as a person does, and says how long it takes: `node --experimental-websocket tests/browser/report.mjs REPORT.html [PICTURES]`.
// Needs Node from 20.10 on and Chromium. Exit code 1 where something does not happen.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

const [file, pictures] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), "report-"));
const options = ["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0", `--user-data-dir=${folder}`];
const browser = spawn("chromium", [...options, "about:blank"], { stdio: ["ignore", "ignore", "pipe"] });
const address = await new Promise((found, failed) => {
  let told = "";
  browser.stderr.on("data", (text) => {
    told += text;
    const match = told.match(/ws:\/\/\S+/);
    if (match) found(match[0]);
  });
  browser.on("exit", () => failed(new Error(told)));
});
const targets = await (await fetch(`http://${new URL(address).host}/json`)).json();
const socket = new WebSocket(targets.find((it) => it.type === "page").webSocketDebuggerUrl);
await new Promise((open) => socket.addEventListener("open", open));
const waiting = new Map(), errors = [];
let calls = 0;
socket.addEventListener("message", ({ data }) => {
  const { id, result, error, method, params } = JSON.parse(data);
  if (method === "Runtime.exceptionThrown") errors.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
  if (!waiting.has(id)) return;
  const [done, failed] = waiting.get(id);
  waiting.delete(id);
  if (error) failed(new Error(error.message)); else done(result);
});
const call = (method, params = {}) => new Promise((done, failed) => {
  waiting.set(++calls, [done, failed]);
  socket.send(JSON.stringify({ id: calls, method, params }));
});
const tell = async (expression) => {
  const { result, exceptionDetails } = await call("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
  if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
  return result.value;
};
// Until what an expression changed is on the screen.
const painted = (act) => tell(`(async () => {
  const begun = performance.now();
  ${act};
  await new Promise((done) => requestAnimationFrame(() => setTimeout(done, 0)));
  return performance.now() - begun;
})()`);
const show = async (name, width, height, scheme = "light") => {
  if (!pictures) return;
  await call("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: false });
  await call("Emulation.setEmulatedMedia", { features: [{ name: "prefers-color-scheme", value: scheme }] });
  await new Promise((done) => setTimeout(done, 700));
  const { data } = await call("Page.captureScreenshot", { format: "png" });
  writeFileSync(join(pictures, `${name}.png`), Buffer.from(data, "base64"));
};
const held = [];
const hold = (what, is_so) => {
  held.push([what, Boolean(is_so)]);
  console.log(`${is_so ? "ok  " : "FAIL"}  ${what}`);
};
const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];

try {
  await call("Runtime.enable");
  await call("Page.enable");
  await call("Emulation.setDeviceMetricsOverride", { width: 1280, height: 1000, deviceScaleFactor: 1, mobile: false });
  const loaded = new Promise((done) => socket.addEventListener("message", ({ data }) => {
    if (JSON.parse(data).method === "Page.loadEventFired") done();
  }));
  await call("Page.navigate", { url: `file://${resolve(file)}` });
  await loaded;
  await tell(`(async () => { while (!document.documentElement.dataset.ready) await new Promise((done) => setTimeout(done, 5)); })()`);
  const paint = await tell(`(async () => {
    for (let n = 0; n < 500; n++) {
      const [found] = performance.getEntriesByName("first-contentful-paint");
      if (found) return found.startTime;
      await new Promise((done) => setTimeout(done, 10));
    }
    return 1e9;
  })()`);
  const ready = await tell("performance.now()");
  console.log(`${(statSync(file).size / 1e6).toFixed(2)} MB, first paint ${paint.toFixed(0)} ms, ready ${ready.toFixed(0)} ms`);
  hold("the first paint comes within 2 s", paint <= 2000);
  await show("wide", 1280, 6400);
  await show("dark", 1280, 2600, "dark");
  await show("narrow", 420, 2600);
  await call("Emulation.setEmulatedMedia", { features: [] });
  await call("Emulation.setDeviceMetricsOverride", { width: 1280, height: 1000, deviceScaleFactor: 1, mobile: false });

  // Pointing at a strip moves the cursor in it, the dot on the path, and the program's line.
  await tell("document.querySelector('.strips').scrollIntoView({ block: 'start' })");
  await new Promise((done) => setTimeout(done, 400));
  const box = await tell(`(() => {
    const { x, y, width, height } = document.querySelector('.strips svg').getBoundingClientRect();
    return { x, y, width, height };
  })()`);
  const mouse = (type, share, more = {}) => call("Input.dispatchMouseEvent", {
    type, x: box.x + share * box.width, y: box.y + 60, button: "left", buttons: more.buttons ?? 0, clickCount: more.clickCount ?? 0,
  });
  const state = () => tell(`({
    where: document.querySelector('#where').textContent, said: document.querySelector('#said').textContent,
    cursor: document.querySelector('.cursor').getAttribute('d'), dot: document.querySelector('.here')?.getAttribute('cx'),
    line: document.querySelector('.strips .line').getAttribute('d'),
    now: document.querySelector('#listing .now')?.textContent ?? '', span: document.querySelector('#span').textContent,
  })`);
  await mouse("mouseMoved", 0.3);
  await new Promise((done) => setTimeout(done, 100));
  const one = await state();
  await mouse("mouseMoved", 0.6);
  await new Promise((done) => setTimeout(done, 100));
  const other = await state();
  hold("the cursor follows the pointer", one.cursor && other.cursor && one.cursor !== other.cursor);
  hold("the dot on the tool path follows it", one.dot && other.dot && one.dot !== other.dot);
  hold("the line of the program is told and marked", /^line \d+/.test(other.said) && other.said.includes(other.now.replace(/^\d+[\d.]* µm/, "").trim()));
  console.log(`      ${other.where}\n      ${other.said}`);

  // Dragging zooms; all strips that are seen are drawn anew.
  await mouse("mousePressed", 0.4, { buttons: 1, clickCount: 1 });
  await mouse("mouseMoved", 0.5, { buttons: 1 });
  await mouse("mouseReleased", 0.5, { clickCount: 1 });
  await new Promise((done) => setTimeout(done, 200));
  const zoomed = await state();
  hold("dragging zooms", / to /.test(zoomed.span));
  hold("plots are drawn anew", zoomed.line !== other.line);
  await tell("document.querySelector('svg[data-matrix]').scrollIntoView()");
  await new Promise((done) => setTimeout(done, 300));
  const stretch = await tell("document.querySelector('.stretch').getAttribute('d').length");
  hold("the stretch is shown on the tool path", stretch > 10);
  await show("zoomed", 1280, 1000);
  await tell("document.querySelector('svg[data-matrix]').scrollIntoView()");
  await show("near", 1280, 1000);

  const has_errors = await tell("Boolean(document.querySelector('.card'))");
  const magnified = await tell(`(() => {
    const title = [...document.querySelectorAll('h3')].find((it) => it.textContent.includes('magnified'));
    return title && [...title.nextElementSibling.querySelectorAll('.programmed, .path')].map((it) => it.getAttribute('d').length);
  })()`);
  hold("the contour error is shown along the whole path", !has_errors || magnified.length > 2 && magnified.every((it) => it > 10));

  // Times of zooms, from the whole and back, with two sections of strips in sight.
  await call("Emulation.setDeviceMetricsOverride", { width: 1280, height: 1400, deviceScaleFactor: 1, mobile: false });
  await tell("document.querySelectorAll('.strips')[1]?.scrollIntoView()");
  await new Promise((done) => setTimeout(done, 500));
  const times = [];
  for (let n = 0; n < 20; n++) {
    times.push(await painted("document.querySelector('[data-act=whole]').click()"));
    times.push(await painted("document.querySelector('[data-act=closer]').click()"));
  }
  const most = Math.max(...times);
  console.log(`      zoom: median ${median(times).toFixed(0)} ms, greatest ${most.toFixed(0)} ms of ${times.length}`);
  hold("a zoom takes 100 ms at most, by its median", median(times) <= 100);
  if (has_errors) {
    await tell("document.querySelector('.card').click()");
    hold("a worst place is gone to", / to /.test((await state()).span));
  }
  hold(`nothing is thrown${errors.length ? `: ${errors[0]}` : ""}`, errors.length === 0);
} finally {
  socket.close();
  browser.kill("SIGKILL");
  await new Promise((done) => setTimeout(done, 300));
  rmSync(folder, { recursive: true, force: true });
}
process.exit(held.every(([, is_so]) => is_so) ? 0 : 1);
