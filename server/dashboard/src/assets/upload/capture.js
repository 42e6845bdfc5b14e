// The files of a capture: by the paths that they have in it, and why they can't be one.
const form = document.querySelector("#add form");
const rules = JSON.parse(form.dataset.rules);
const ends = (path, endings) => endings.some((it) => path.toLowerCase().endsWith(it));
const mib = (bytes) => (bytes < 1e5 ? `${(bytes / 1024).toFixed(1)} KiB` : `${(bytes / 1048576).toFixed(1)} MiB`);
const total = (files) => [...files.values()].reduce((sum, it) => sum + it.size, 0);

// All files below an entry that was dropped, with their paths.
const walk = async (entry, into, inside = "") => {
  const path = inside + entry.name;
  if (entry.isFile) return into.push([path, await new Promise((yes, no) => entry.file(yes, no))]);
  const reader = entry.createReader();
  const next = () => new Promise((yes, no) => reader.readEntries(yes, no));
  for (let some; (some = await next()).length;) for (const it of some) await walk(it, into, `${path}/`);
};

// By path, without the folder around all and without what systems put into folders. The service knows an archive of all and a
// film by their names.
const arranged = (found) => {
  found = found.filter(([path]) => !/(^|\/)(\.|__MACOSX\/|Thumbs\.db$|desktop\.ini$)/.test(path)).sort(([a], [b]) => (a < b ? -1 : 1));
  const outer = `${found[0]?.[0].split("/")[0]}/`;
  const inner = found.every(([path]) => path.startsWith(outer)) ? outer.length : 0;
  const files = new Map(found.map(([path, file]) => [path.slice(inner), file]));
  const paths = [...files.keys()], top = paths.filter((it) => !it.includes("/"));
  const rename = (from, to) => { if (from !== to) files.set(to, files.get(from)) && files.delete(from); };
  const packed = top.filter((it) => ends(it, rules.packed) && !/^(frames|masks)\./.test(it));
  const films = top.filter((it) => ends(it, rules.videos) && !/^masks\./.test(it));
  const posed = rules.tracks.some((it) => files.has(it));
  if (!posed && packed.length === 1) rename(packed[0], `capture${rules.packed.find((it) => ends(packed[0], [it]))}`);
  const plain = !paths.some((it) => /^(frames[./]|media\.json$)/.test(it));
  const alone = rules.films && paths.length === 1 && films.length === 1;
  if ((alone || (posed && plain)) && films.length === 1) rename(films[0], `video.${films[0].split(".").pop()}`);
  return files;
};

// What the service would refuse, or find only after all was sent.
const faultsOf = (files) => {
  const paths = [...files.keys()], bad = [];
  if (!paths.length) return ["No file is chosen: choose or drop a folder, its files, or an archive of it."];
  if (paths.length > rules.files) bad.push(`${paths.length} files; a capture has at most ${rules.files}`);
  if (total(files) > rules.bytes) bad.push(`${mib(total(files))}; a capture has at most ${mib(rules.bytes)}`);
  for (const [path, { size }] of files) {
    if (!size) bad.push(`${path}: is empty`);
    if (ends(path, rules.pictures) && !/\/|^background\./.test(path) && !files.has("media.json")) {
      bad.push(`${path}: pictures are in frames/ and masks/: choose the folder that has both`);
    }
  }
  const film = rules.films && paths.length === 1 && ends(paths[0], rules.videos);
  if (!film && ![...rules.tracks, ...rules.archives].some((it) => files.has(it))) {
    const films = paths.every((it) => ends(it, rules.videos));
    bad.unshift(!films ? rules.none : rules.films ? "One film makes one person: choose one." : rules.film);
  }
  return bad;
};
