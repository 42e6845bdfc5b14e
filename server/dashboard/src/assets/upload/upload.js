// Adds a person: sends the files in parts, and goes on where the service stands after a lost connection or a reload. The service
// says what is there; the browser keeps only which upload it was, with paths and sizes.
const { display_name: name, consent_note: note, folder, files: several, token } = form.elements;
const [chosen, says, faults, progress] = ["chosen", "says", "faults", "sent"].map((it) => document.getElementById(`upload-${it}`));
const [send, drop] = form.querySelectorAll("button");
// The person who gets a further capture, by id; none: somebody new.
const { person } = form.dataset, slot = person ? `upload-${person}` : "upload";
const box = form.parentElement, zone = form.querySelector(".drop");

// Bytes of the first part. Milliseconds: of a good part, of the longest call, and of the longest pause.
const FIRST = 1 << 20, GOOD = 2000, LONGEST = 120000, PAUSE = 30000;
let files = new Map(), sending = files, all = 0, busy = false, stopped = false, size = FIRST, failures = 0, taken = 0, kept, wake, current;

// What others wrote is text, with hidden characters written out.
const shown = (text) => String(text).replace(/\p{C}/gu, (it) => `\\u{${it.codePointAt(0).toString(16)}}`);
const say = (words) => { says.textContent = shown(words); };
const list = (lines) => {
  const some = lines.length > 20 ? [...lines.slice(0, 20), `${lines.length - 20} more`] : lines;
  faults.replaceChildren(...some.map((it) => Object.assign(document.createElement("li"), { textContent: shown(it) })));
};
const meter = (done, words) => {
  progress.hidden = false;
  Object.assign(progress.firstElementChild, { max: all, value: done });
  progress.lastElementChild.textContent = shown(`${mib(done)} of ${mib(all)}: ${words}`);
};
const keep = (what) => {
  kept = what;
  try {
    if (what) localStorage[slot] = JSON.stringify(what);
    else delete localStorage[slot];
  } catch {
    list(["The browser can't note so many files: this upload does not go on after a reload of the page."]);
  }
};
const stop = () => { if (stopped) throw new Error("stopped"); };
const idOf = (resource) => resource.split("/")[1];

// An answer that is none: its words, and whether the same may be asked again.
class Refused extends Error {
  constructor(status, text) {
    super(text);
    this.status = status;
    try {
      const { detail, reason, fields = [] } = JSON.parse(text);
      Object.assign(this, { reason, fields, lines: fields.length ? fields.map((it) => `${it.field}: ${it.detail}`) : [detail] });
    } catch {
      const { body } = new DOMParser().parseFromString(text, "text/html");
      this.lines = [(body.querySelector(".message") ?? body).textContent.trim().slice(0, 500)];
    }
    if (status === 401) this.lines.push("Reload the page to sign in with another key; an upload that has begun goes on.");
  }

  get passes() {
    if (this.reason === "UPLOAD_TAKEN_OVER") return ++taken < 4;
    return this.status >= 500 || /^UPLOAD_(OFFSET|INCOMPLETE)$/.test(this.reason);
  }
}

const call = async (method, path, body, headers, longest = LONGEST) => {
  current = new AbortController();
  const limit = setTimeout(() => current.abort(), longest);
  try {
    const asked = { method, body, headers: { "x-yoto-token": token.value, ...headers }, cache: "no-store", signal: current.signal };
    const answer = await fetch(`/people/upload/${path}`, asked), text = await answer.text();
    if (!answer.ok) throw new Refused(answer.status, text);
    return JSON.parse(text);
  } finally {
    clearTimeout(limit);
  }
};
const create = (path, what, id) => call("POST", path, JSON.stringify(what), { "content-type": "application/json", "idempotency-key": id });

// Does `work`, again after each fault that passes by itself.
const lasting = async (work) => {
  for (;;) {
    stop();
    try {
      return await work();
    } catch (fault) {
      const lost = fault instanceof TypeError || fault.name === "AbortError";
      if (stopped || !(lost || fault.passes)) throw fault;
      const pause = Math.min(PAUSE, 500 * 2 ** failures++);
      say(`${lost ? "The service does not answer" : fault.lines[0]}: trying again in ${Math.ceil(pause / 1000)} s.`);
      await new Promise((yes) => setTimeout((wake = yes), pause));
    }
  }
};

// What is sent: the files, or an archive of them.
const collect = async () => {
  const pack = kept ? kept.packed : arePacked(files);
  const failed = () => { throw new Refused(0, "A file can't be read; was it moved or changed?"); };
  if (pack) say("Packing the files.");
  sending = pack ? new Map([["capture.zip", await packed(files, (path, done) => { stop(); meter(done, path); }).catch(failed)]]) : files;
  all = total(sending);
};

const begin = async () => {
  say(`Checking the files.${crypto.subtle ? "" : " This address has no TLS, so the page computes checksums by itself, which takes longer."}`);
  const listed = [];
  let done = 0;
  for (const [path, file] of sending) {
    stop();
    meter(done, path);
    const sum = await sha256(file).catch(() => { throw new Refused(0, `${path}: can't be read; was it moved or changed?`); });
    listed.push({ path, bytes: file.size, sha256: sum });
    done += file.size;
  }
  const id = hex(crypto.getRandomValues(new Uint8Array(16)));
  const made = () => create("person", { display_name: name.value, consent_note: note.value }, id);
  const { name: subject } = person ? { name: `subjects/${person}` } : await lasting(made);
  try {
    const upload = await lasting(() => create("files", { subject, files: listed }, id));
    keep({ person: idOf(subject), id: idOf(upload.name), name: name.value, packed: sending !== files, files: [...files].map(([path, it]) => [path, it.size]) });
  } catch (fault) {
    // A person without files would only be in the way.
    if (!person) await call("POST", `cancel/${idOf(subject)}`).catch(() => {});
    throw fault;
  }
};

const deliver = async () => {
  const state = await call("GET", `files/${kept.id}?stop_writer=true`);
  const there = new Map(state.committed.map((it) => [it.path, Number(it.bytes)]));
  let done = Number(state.committed_bytes);
  say(done ? `Sending goes on after ${mib(done)}.` : "Sending.");
  for (const [path, file] of state.state === "OPEN" ? sending : []) {
    for (let from = there.get(path) ?? 0, to; from < file.size; from = to) {
      meter(done, path);
      to = Math.min(file.size, from + size);
      const began = performance.now(), range = `bytes ${from}-${to - 1}/${file.size}`;
      await call("PUT", `files/${kept.id}/${encodeURIComponent(path)}`, file.slice(from, to), { "content-range": range });
      const took = performance.now() - began;
      if (took > GOOD * 2) size = Math.max(1 << 16, size / 2);
      else if (to - from === size && took < GOOD / 2) size = Math.min(8 << 20, size * 2);
      done += to - from;
      failures = 0;
    }
  }
  meter(done, "comparing checksums");
  await call("POST", `finish/${kept.id}`, undefined, {}, 900000);
};

const show = (fault) => {
  const gone = fault.status === 404 || fault.reason === "UPLOAD_GONE";
  say(gone ? "The upload is no longer there, and begins anew." : kept ? "The upload has stopped." : "Nothing was sent.");
  if (gone) keep();
  for (const it of [note, name]) {
    const bad = fault.fields?.some(({ field }) => field === it.name) || (it === name && fault.status === 409 && !kept);
    it.setAttribute("aria-invalid", Boolean(bad));
  }
  list(fault.lines ?? [`The page has failed: ${fault.message}`]);
};

const set = (is) => {
  busy = is;
  form.toggleAttribute("data-busy", is);
  for (const it of [folder, several, send]) it.disabled = is;
  for (const it of [name, note]) it.disabled = is || kept;
  if (kept) name.value = kept.name;
  note.parentElement.hidden = Boolean(kept || person);
  send.textContent = kept ? "Go on" : "Upload";
  drop.hidden = !is && !kept;
  progress.hidden &&= !is;
};

const giveUp = async () => {
  try {
    if (kept) await call("POST", person ? `cancel-capture/${kept.id}` : `cancel/${kept.person}`);
  } catch (fault) {
    if (fault.status !== 404) return show(fault);
  }
  keep();
  say("The upload was given up, and nothing of it is kept.");
};

const run = async () => {
  [stopped, failures, taken] = [false, 0, 0];
  list([]);
  set(true);
  try {
    await collect();
    if (!kept) await begin();
    await lasting(deliver);
    const page = `/people/${kept.person}`;
    keep();
    return location.assign(page);
  } catch (fault) {
    if (stopped) await giveUp();
    else show(fault);
  }
  progress.hidden = true;
  set(false);
};

// Whether the chosen files can be sent, or are those of the upload that goes on.
const fits = () => {
  const bad = faultsOf(files), known = new Map(kept?.files ?? []);
  for (const [path, bytes] of known) {
    if (files.get(path)?.size !== bytes) bad.push(`${path}: has ${bytes} bytes in the upload, and is not among these files`);
  }
  if (kept) for (const path of files.keys()) if (!known.has(path)) bad.push(`${path}: is no file of the upload`);
  list(bad);
  return !bad.length;
};
const take = (found) => {
  if (busy) return;
  files = arranged(found);
  all = total(files);
  const renamed = [...files].filter(([path, it]) => !path.endsWith(it.name)).map(([path, it]) => `; ${it.name} becomes ${path}`);
  chosen.textContent = shown(`${files.size} file${files.size === 1 ? "" : "s"}, ${mib(all)}${renamed.join("")}`);
  if (fits() && kept) run();
};

form.addEventListener("submit", (event) => {
  event.preventDefault();
  if (!busy && fits()) run();
});
drop.addEventListener("click", async () => {
  if (!confirm("Give this upload up? What was sent is deleted.")) return;
  list([]);
  stopped = true;
  current?.abort();
  wake?.();
  if (busy) return;
  await giveUp();
  set(false);
});
for (const field of [folder, several]) {
  field.addEventListener("change", () => {
    (field === folder ? several : folder).value = "";
    take([...field.files].map((it) => [it.webkitRelativePath || it.name, it]));
  });
}
addEventListener("online", () => wake?.());

const drag = (event) => {
  if (!event.dataTransfer?.types.includes("Files")) return;
  event.preventDefault();
  box.open = true;
  zone.classList.toggle("over", event.type !== "drop");
};
addEventListener("dragover", drag);
addEventListener("dragleave", (event) => { if (!event.relatedTarget) zone.classList.remove("over"); });
addEventListener("drop", async (event) => {
  drag(event);
  // Only now: they are gone once something was waited for.
  const entries = [...event.dataTransfer.items].map((it) => it.webkitGetAsEntry()), found = [];
  try {
    for (const it of entries) if (it) await walk(it, found);
    if (!busy) folder.value = several.value = "";
    if (entries.length) take(found);
  } catch (fault) {
    list([`What was dropped can't be read: ${fault.message}`]);
  }
});

try { kept = JSON.parse(localStorage[slot]); } catch { /* There is none. */ }
form.hidden = false;
set(false);
if (kept) {
  box.open = true;
  say(`The upload of ${kept.name} has not ended. Choose or drop the same ${kept.files.length} files again (${kept.files[0][0]}, …), and it goes on.`);
  call("GET", `files/${kept.id}`).catch((fault) => {
    if (fault.status && !busy) show(fault);
    set(busy);
  });
}
