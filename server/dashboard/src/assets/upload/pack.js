// Many small files as one archive: each file would be a request of its own, which takes longer than its bytes.

// Fewest files that are packed, and bytes of one on average and at most. Bytes of all: without larger fields (ZIP64), 4 GiB is the end.
const MANY = 32, SMALL = 1 << 20, LARGE = 1 << 26, ALL = 2 ** 31;
// An archive within would stay packed, and a large file gains nothing.
const arePacked = (files) =>
  files.size >= MANY && files.size < 65535 && total(files) < Math.min(ALL, SMALL * files.size)
  && [...files].every(([path, { size }]) => size < LARGE && (path.includes("/") || !ends(path, rules.packed)));

const CRC = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let bit = 0; bit < 8; bit++) n = n & 1 ? (n >>> 1) ^ 0xedb88320 : n >>> 1;
  return n;
});
const crc32 = (bytes) => {
  let sum = ~0;
  for (const byte of bytes) sum = CRC[(sum ^ byte) & 255] ^ (sum >>> 8);
  return ~sum >>> 0;
};

// Fields of a ZIP: [bytes, value].
const record = (fields) => {
  const view = new DataView(new ArrayBuffer(fields.reduce((sum, [width]) => sum + width, 0)));
  let at = 0;
  for (const [width, value] of fields) {
    if (width === 2) view.setUint16(at, value, true);
    else view.setUint32(at, value, true);
    at += width;
  }
  return view.buffer;
};

// A ZIP of the files as they are, which is the same whenever it is made of the same files. `told` hears of each file.
const packed = async (files, told) => {
  const parts = [], central = [];
  let at = 0, listed = 0;
  for (const [path, file] of files) {
    told(path, at);
    const name = new TextEncoder().encode(path), sum = crc32(new Uint8Array(await file.arrayBuffer()));
    // Version 2.0, names in UTF-8, stored, 1 January 1980, sizes, and no extra field.
    const common = [[2, 20], [2, 0x0800], [2, 0], [2, 0], [2, 0x21], [4, sum], [4, file.size], [4, file.size], [2, name.length], [2, 0]];
    const head = record([[4, 0x04034b50], ...common]);
    const entry = record([[4, 0x02014b50], [2, 20], ...common, [2, 0], [2, 0], [2, 0], [4, 0], [4, at]]);
    parts.push(head, name, file);
    central.push(entry, name);
    at += head.byteLength + name.length + file.size;
    listed += entry.byteLength + name.length;
  }
  const end = record([[4, 0x06054b50], [2, 0], [2, 0], [2, files.size], [2, files.size], [4, listed], [4, at], [2, 0]]);
  return new Blob([...parts, ...central, end]);
};
