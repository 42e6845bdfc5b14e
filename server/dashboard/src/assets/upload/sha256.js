// SHA-256, for what the browser does not compute: addresses without TLS, and files that are too large for its memory.
// Its constants are fractions of roots of the first primes.
const primes = [];
for (let n = 2; primes.length < 64; n++) if (primes.every((it) => n % it)) primes.push(n);
const K = Int32Array.from(primes, (it) => Math.cbrt(it) * 2 ** 32);
const H = Int32Array.from(primes.slice(0, 8), (it) => Math.sqrt(it) * 2 ** 32);
const turn = (x, n) => (x >>> n) | (x << (32 - n));

// Adds whole blocks of 64 bytes to the state `h`.
const blocks = (h, bytes) => {
  const view = new DataView(bytes.buffer), w = new Int32Array(64);
  for (let from = 0; from < bytes.length; from += 64) {
    let a = h[0], b = h[1], c = h[2], d = h[3], e = h[4], f = h[5], g = h[6], i = h[7];
    for (let t = 0; t < 64; t++) {
      if (t < 16) w[t] = view.getInt32(from + 4 * t);
      else {
        const x = w[t - 15], y = w[t - 2];
        w[t] = w[t - 16] + (turn(x, 7) ^ turn(x, 18) ^ (x >>> 3)) + w[t - 7] + (turn(y, 17) ^ turn(y, 19) ^ (y >>> 10));
      }
      const one = (i + (turn(e, 6) ^ turn(e, 11) ^ turn(e, 25)) + ((e & f) ^ (~e & g)) + K[t] + w[t]) | 0;
      const two = ((turn(a, 2) ^ turn(a, 13) ^ turn(a, 22)) + ((a & b) ^ (a & c) ^ (b & c))) | 0;
      i = g; g = f; f = e; e = (d + one) | 0;
      d = c; c = b; b = a; a = (one + two) | 0;
    }
    h[0] += a; h[1] += b; h[2] += c; h[3] += d; h[4] += e; h[5] += f; h[6] += g; h[7] += i;
  }
};
const hex = (bytes) => [...bytes].map((it) => it.toString(16).padStart(2, "0")).join("");

const sha256 = async (file) => {
  const read = async (from, to) => new Uint8Array(await file.slice(from, to).arrayBuffer());
  const MOST = 256 << 20, PIECE = 1 << 20;
  if (crypto.subtle && file.size <= MOST) return hex(new Uint8Array(await crypto.subtle.digest("SHA-256", await read(0, MOST))));
  const h = Int32Array.from(H), whole = file.size - (file.size % 64);
  for (let from = 0; from < whole; from += PIECE) blocks(h, await read(from, Math.min(whole, from + PIECE)));
  const rest = await read(whole, file.size), last = new Uint8Array(rest.length < 56 ? 64 : 128);
  last.set(rest);
  last[rest.length] = 128;
  new DataView(last.buffer).setBigUint64(last.length - 8, BigInt(file.size) * 8n);
  blocks(h, last);
  const bytes = new DataView(new ArrayBuffer(32));
  h.forEach((it, at) => bytes.setInt32(4 * at, it));
  return hex(new Uint8Array(bytes.buffer));
};
