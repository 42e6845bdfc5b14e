// Checks the pages for people with tools of others: node check.mjs PROGRAM [PICTURES]
//
// A service of the program is started in an empty folder, and a person is filmed, uploaded, trained and exported by its commands. Then
// axe-core looks at every page in a phone's and a desktop's width, in light and dark: a finding that is serious or critical is
// a fault, and so is a page that is wider than its window or reports an error on the console. Needs Chromium, and the packages of
// package.json in the folder YOTO_PAGES_TOOLS. PICTURES is a folder for a picture of every page.

import { spawn, spawnSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

const tools = process.env.YOTO_PAGES_TOOLS ?? ".";
const from = createRequire(resolve(tools, "package.json"));
const puppeteer = from("puppeteer-core");
const axe = readFileSync(from.resolve("axe-core/axe.min.js"), "utf8");

const [program, pictures] = process.argv.slice(2).map((path) => resolve(path));
const WIDTHS = [390, 1440];
const SCHEMES = ["light", "dark"];
/** Longest time for a step of the browser, milliseconds. */
const PATIENCE = 180_000;
/** What is a fault, of axe's four impacts. */
const FAULTS = ["serious", "critical"];

const folder = mkdtempSync(join(tmpdir(), "yoto-pages-"));

/** A service of its own, and its address. */
function served() {
  const options = ["serve", "--data", join(folder, "data"), "--listen", "127.0.0.1:0"];
  const service = spawn(program, options, { stdio: ["ignore", "pipe", "pipe"] });
  return new Promise((done, failed) => {
    let said = "";
    const read = (bytes) => {
      said += bytes;
      const address = said.match(/dashboard at (http:\S+?)\/?\s/);
      if (address) done([service, address[1]]);
    };
    service.stdout.on("data", read);
    service.stderr.on("data", read);
    service.on("exit", () => failed(new Error(`the service did not start:\n${said}`)));
  });
}

/** What a command prints as JSON. */
function yoto(address, line) {
  const words = [...line.split(" "), "--output", "json", "--no-progress"];
  const env = { ...process.env, YOTO_SERVER: address };
  const ended = spawnSync(program, words, { cwd: folder, env, encoding: "utf8" });
  if (ended.status !== 0) throw new Error(`yoto ${line}:\n${ended.stderr}${ended.stdout}`);
  return JSON.parse(ended.stdout || "{}");
}

/** One of everything; the paths of pages that show it, by names. */
function content(address) {
  spawnSync(program, ["capture", "example", "--out", "captures", "--size", "96"], { cwd: folder });
  yoto(address, "subject add ada captures/ada --consent example");
  yoto(address, "subject consent ada --note on-paper");
  const training = yoto(address, "train solo --subjects ada --seconds 12 --size 96");
  const export_ = yoto(address, "export solo --subject ada --out ada.html");
  yoto(address, "evaluate solo");
  const share = yoto(address, `share create --job ${export_.job.name} --embed`);
  const person = yoto(address, "subject show ada").subject.name.replace("subjects", "people");
  const model = yoto(address, "model show solo").model.name;
  const id = model.split("/")[1];
  return {
    overview: "/", people: "/people", person: `/${person}`, models: "/models", model: `/${model}`,
    report: `/${model}/report.html`, comparison: `/compare?one=${id}&other=${id}`, jobs: "/jobs",
    training: `/${training.job.name}`, export: `/${export_.job.name}`, workers: "/workers", service: "/service",
    share: new URL(share.url).pathname, "sign-in": "/sign-in",
  };
}

/** What is wrong with a page, in words. */
async function faultsOf(page, name, address, width, scheme) {
  const faults = [];
  const heard = (message) => message.type() === "error" && faults.push(`says ${message.text()}`);
  page.on("console", heard);
  await page.setViewport({ width, height: 900, isMobile: width < 500, hasTouch: width < 500 });
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  await page.goto(address, { waitUntil: "load" });
  const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  if (wide > 0) faults.push(`is ${wide} pixels wider than its window`);
  page.off("console", heard);
  if (pictures) {
    await page.screenshot({ path: join(pictures, `${name}-${width}-${scheme}.png`), fullPage: width > 500 });
  }
  // The policy of a page lets it run no script but its own.
  const found = await page.evaluate(`(() => { ${axe}; return axe.run(document, { iframes: false }); })()`);
  const counts = {};
  for (const { id, impact, nodes, help } of found.violations) {
    counts[`${id} (${impact})`] = (counts[`${id} (${impact})`] ?? 0) + 1;
    if (FAULTS.includes(impact)) faults.push(`${id} (${impact}): ${help}: ${nodes.map((it) => it.html.slice(0, 120)).join(" | ")}`);
  }
  return [faults, counts, found.passes.length];
}

const [service, address] = await served();
let failed = false;
try {
  const paths = content(address);
  if (pictures) mkdirSync(pictures, { recursive: true });
  const browser = await puppeteer.launch({
    protocolTimeout: PATIENCE,
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"],
  });
  const all = {};
  let looks = 0;
  let passes = 0;
  for (const [name, path] of Object.entries(paths)) {
    for (const width of WIDTHS) {
      for (const scheme of SCHEMES) {
        const page = await browser.newPage();
        page.setDefaultTimeout(PATIENCE);
        await page.setBypassCSP(true);
        const [faults, counts, passed] = await faultsOf(page, name, address + path, width, scheme);
        await page.close();
        looks += 1;
        passes += passed;
        for (const [finding, count] of Object.entries(counts)) all[finding] = (all[finding] ?? 0) + count;
        for (const fault of faults) console.error(`${name} at ${width} pixels, ${scheme}: ${fault}`);
        failed ||= faults.length > 0;
      }
    }
  }
  await browser.close();
  console.log(`${Object.keys(paths).length} pages, ${looks} looks: ${passes} rules passed, findings ${JSON.stringify(all)}`);
} finally {
  service.kill();
  rmSync(folder, { recursive: true, force: true });
}
process.exit(failed ? 1 : 0);
