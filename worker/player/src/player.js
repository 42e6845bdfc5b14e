// Plays one person on a canvas: splats that bones carry, sorted back to front and drawn by WebGL2. All numbers are in
// metres and seconds; matrices are row-major 3x4; quaternions have the real part first. Throws an error whose message
// is for people where the canvas can't be drawn on.
function createPlayer(canvas, person) {
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const joints = person.joints.length;
  // Joints of fingers come last. They carry splats, and take no part in pose blend shapes.
  const fingers = person.joints.indexOf("l_index1");
  const known = fingers < 0 ? joints : fingers;
  const count = person.count;

  // The splats, as `packed.rs` writes them: 18 numbers of 16 bits each.
  const STRIDE = 18;
  const packed = bytes(person.splats);
  const numbers = new Uint16Array(packed.buffer);
  const means = new Float32Array(3 * count);
  const texels = 4;
  const across = 256;
  const tableRows = Math.ceil(count / across);
  const table = new Float32Array(4 * texels * across * tableRows);
  const bones = new Uint8Array(4 * across * tableRows);
  const shares = new Uint8Array(4 * across * tableRows);
  const between = ([low, high], value) => low + ((high - low) * value) / 65535;
  for (let i = 0; i < count; i++) {
    const at = i * STRIDE;
    const to = 4 * texels * i;
    for (let a = 0; a < 3; a++) {
      const range = [person.box[0][a], person.box[1][a]];
      means[3 * i + a] = table[to + a] = between(range, numbers[at + a]);
      table[to + 8 + a] = Math.exp(between(person.ranges.deviations, numbers[at + 7 + a]));
      table[to + 12 + a] = between(person.ranges.colours, numbers[at + 11 + a]);
    }
    for (let a = 0; a < 4; a++) {
      table[to + 4 + a] = between([-1, 1], numbers[at + 3 + a]);
      bones[4 * i + a] = packed[2 * at + 28 + a];
      shares[4 * i + a] = packed[2 * at + 32 + a];
    }
    table[to + 3] = between([0, 1], numbers[at + 10]);
  }

  // Which splats are guessed, a bit each: the fourth number of the colour's texel.
  const guesses = bytes(person.guessed);
  let guessed = 0;
  for (let i = 0; i < count; i++) {
    const bit = (guesses[i >> 3] >> (i & 7)) & 1;
    table[4 * texels * i + 15] = bit;
    guessed += bit;
  }

  // What colours gain by the view: one texel per harmonic.
  const harmonics = (person.degree + 1) ** 2 - 1;
  const shine = new Uint8Array(4 * Math.max(harmonics, 1) * across * tableRows);
  bytes(person.harmonics).forEach((value, i) => {
    shine[4 * Math.floor(i / 3) + (i % 3)] = value;
  });

  // Pose blend shapes: what poses do to clothes on top of bones. The joints near a splat, and how near they are.
  const shapes = person.shapes && {
    ...person.shapes,
    basis: new Float32Array(bytes(person.shapes.basis).buffer),
    limits: new Float32Array(bytes(person.shapes.limits).buffer),
    weights: Float32Array.from(bytes(person.shapes.weights), (b) => ((b - 128) / 127) * person.shapes.most),
    ...nearness(person.shapes.reach),
  };
  function nearness(reach) {
    const [starts, near, how] = [new Uint32Array(count + 1), [], []];
    const apart = (i, at, way) => {
      const off = at.map((x, a) => means[3 * i + a] - x);
      const square = way ? way.reduce((sum, x) => sum + x * x, 0) : 0;
      const part = way ? way.reduce((sum, x, a) => sum + x * off[a], 0) / Math.max(square, 1e-9) : 0;
      const along = Math.min(Math.max(part, 0), 1);
      return off.reduce((sum, x, a) => sum + (way ? x - along * way[a] : x) ** 2, 0);
    };
    const rests = person.rest.slice(0, known);
    const bones = person.parents.slice(0, known).flatMap((parent, child) =>
      parent === null ? [] : [[parent, person.rest[child].map((x, a) => x - person.rest[parent][a])]],
    );
    for (let i = 0; i < count; i++) {
      const squares = rests.map((at) => apart(i, at));
      for (const [parent, way] of bones) {
        squares[parent] = Math.min(squares[parent], apart(i, person.rest[parent], way));
      }
      squares.forEach((square, joint) => {
        const share = Math.exp(-square / (2 * reach * reach));
        if (share < 1e-3) return;
        near.push(joint);
        how.push(share);
      });
      starts[i + 1] = near.length;
    }
    return { starts, near: Uint16Array.from(near), how: Float32Array.from(how) };
  }

  // The places of the splats before bones carry them; `turns` are the joints' own rotations.
  const shaped = new Float32Array(4 * across * tableRows);
  const unshaped = Float32Array.from(shaped, (_, i) => (i % 4 < 3 ? means[3 * (i >> 2) + (i % 4)] ?? 0 : 0));
  function shape(turns) {
    shaped.set(unshaped);
    if (!shapes) return;
    const width = 3 * shapes.count;
    const given = new Float32Array(width * known);
    for (let joint = 1; joint < known; joint++) {
      for (let f = 0; f < 9; f++) {
        const at = 9 * joint + f;
        const least = shapes.limits[at];
        const greatest = shapes.limits[9 * known + at];
        const value = turns[joint][f] - (f % 4 === 0 ? 1 : 0);
        const feature = Math.max(Math.min(value, greatest), least);
        for (let k = 0; k < width; k++) given[width * joint + k] += feature * shapes.basis[width * at + k];
      }
    }
    const { starts, near, how, weights, count: kinds } = shapes;
    for (let i = 0; i < count; i++) {
      const own = kinds * i;
      let [x, y, z] = [0, 0, 0];
      for (let e = starts[i]; e < starts[i + 1]; e++) {
        const from = width * near[e];
        const share = how[e];
        for (let r = 0; r < kinds; r++) {
          const weight = share * weights[own + r];
          x += given[from + r] * weight;
          y += given[from + kinds + r] * weight;
          z += given[from + 2 * kinds + r] * weight;
        }
      }
      shaped[4 * i] += x;
      shaped[4 * i + 1] += y;
      shaped[4 * i + 2] += z;
    }
  }

  // Clips: per frame, the shift of the root as 3 floats, then the turns of the joints.
  const clips = person.clips.map((clip) => {
    const data = new DataView(bytes(clip.poses).buffer);
    const size = 12 + 8 * joints;
    const frames = [];
    for (let at = 0; at < data.byteLength; at += size) {
      const shift = [0, 4, 8].map((a) => data.getFloat32(at + a, true));
      const turns = new Float32Array(4 * joints);
      for (let i = 0; i < turns.length; i++) {
        turns[i] = data.getInt16(at + 12 + 2 * i, true) / 32767;
      }
      frames.push({ shift, turns });
    }
    return { name: clip.name, fps: clip.fps, up: clip.up, frames };
  });

  const normalised = (v) => {
    const length = Math.hypot(...v) || 1;
    return v.map((x) => x / length);
  };
  const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const matrixOf = ([w, x, y, z]) => [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
  ];
  const turned = (m, v) => [0, 3, 6].map((r) => m[r] * v[0] + m[r + 1] * v[1] + m[r + 2] * v[2]);
  const times = ([a, b, c, d], [e, f, g, h]) => [
    a * e - b * f - c * g - d * h,
    a * f + b * e + c * h - d * g,
    a * g - b * h + c * e + d * f,
    a * h + b * g - c * f + d * e,
  ];

  // The pose between frames of a clip, without a jump through the longer way round.
  function poseAt(clip, time) {
    const last = clip.frames.length - 1;
    const place = Math.min(Math.max(time * clip.fps, 0), last);
    const [one, other] = [clip.frames[Math.floor(place)], clip.frames[Math.ceil(place)]];
    const part = place - Math.floor(place);
    const turns = new Float32Array(4 * joints);
    for (let joint = 0; joint < joints; joint++) {
      const from = 4 * joint;
      let side = 0;
      for (let a = 0; a < 4; a++) side += one.turns[from + a] * other.turns[from + a];
      const sign = side < 0 ? -1 : 1;
      const mixed = [0, 1, 2, 3].map(
        (a) => (1 - part) * one.turns[from + a] + part * sign * other.turns[from + a],
      );
      turns.set(normalised(mixed), from);
    }
    const shift = one.shift.map((x, a) => (1 - part) * x + part * other.shift[a]);
    return { shift, turns };
  }

  // What carries rest points to the world, of each bone.
  function boneMatrices(pose, bends) {
    const [turns, places, locals] = [[], [], []];
    const matrices = new Float32Array(12 * joints);
    for (let joint = 0; joint < joints; joint++) {
      let q = Array.from(pose.turns.subarray(4 * joint, 4 * joint + 4));
      if (bends && bends[joint]) q = times(q, bends[joint]);
      const local = matrixOf(q);
      locals.push(local);
      const rest = person.rest[joint];
      const parent = person.parents[joint];
      if (parent === null) {
        turns.push(local);
        places.push(rest.map((x, a) => x + pose.shift[a]));
      } else {
        const above = turns[parent];
        turns.push(
          [0, 1, 2].flatMap((r) =>
            [0, 1, 2].map(
              (c) =>
                above[3 * r] * local[c] + above[3 * r + 1] * local[3 + c] + above[3 * r + 2] * local[6 + c],
            ),
          ),
        );
        const bone = turned(above, rest.map((x, a) => x - person.rest[parent][a]));
        places.push(bone.map((x, a) => x + places[parent][a]));
      }
      const back = turned(turns[joint], rest);
      for (let r = 0; r < 3; r++) {
        matrices.set(turns[joint].slice(3 * r, 3 * r + 3), 12 * joint + 4 * r);
        matrices[12 * joint + 4 * r + 3] = places[joint][r] - back[r];
      }
    }
    return { matrices, places, locals };
  }

  const gl = canvas.getContext("webgl2", {
    antialias: false,
    premultipliedAlpha: true,
    preserveDrawingBuffer: true,
  });
  if (!gl) throw new Error("This browser has no WebGL2, which this page needs.");

  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, shaders.vertex], [gl.FRAGMENT_SHADER, shaders.fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
    throw new Error(`The shaders do not run here: ${gl.getProgramInfoLog(program)}`);
  }
  gl.useProgram(program);
  const uniforms = new Map();
  function uniform(name) {
    if (!uniforms.has(name)) uniforms.set(name, gl.getUniformLocation(program, name));
    return uniforms.get(name);
  }

  function texture(unit, name, inner, width, height, format, type, data) {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
    }
    gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, height, 0, format, type, data);
    gl.uniform1i(uniform(name), unit);
  }
  texture(0, "splats", gl.RGBA32F, texels * across, tableRows, gl.RGBA, gl.FLOAT, table);
  texture(1, "bones", gl.RGBA8UI, across, tableRows, gl.RGBA_INTEGER, gl.UNSIGNED_BYTE, bones);
  texture(2, "shares", gl.RGBA8, across, tableRows, gl.RGBA, gl.UNSIGNED_BYTE, shares);
  texture(4, "shine", gl.RGBA8, Math.max(harmonics, 1) * across, tableRows, gl.RGBA, gl.UNSIGNED_BYTE, shine);
  gl.uniform1i(uniform("harmonics"), harmonics);
  gl.uniform1f(uniform("most"), person.ranges.harmonic);
  texture(3, "matrices", gl.RGBA32F, 3, joints, gl.RGBA, gl.FLOAT, null);
  texture(5, "places", gl.RGBA32F, across, tableRows, gl.RGBA, gl.FLOAT, null);

  // Two triangles per splat, in one draw: renderers without a GPU are slow at instances. Corner c of the splat in
  // place p is vertex 4 p + c.
  const order = new Uint32Array(4 * count);
  const corners = new Uint32Array(6 * count);
  for (let place = 0; place < count; place++) {
    corners.set([0, 1, 2, 2, 1, 3].map((corner) => 4 * place + corner), 6 * place);
  }
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, order.byteLength, gl.DYNAMIC_DRAW);
  const attribute = gl.getAttribLocation(program, "splat");
  gl.enableVertexAttribArray(attribute);
  gl.vertexAttribIPointer(attribute, 1, gl.UNSIGNED_INT, 0, 0);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.clearColor(0, 0, 0, 0);

  // Far splats first, by a counting sort of their depths.
  const depths = new Float32Array(count);
  const keys = new Uint16Array(count);
  const starts = new Uint32Array(65537);
  function sort(matrices, [, , axis]) {
    // Depth of a point that one bone carries is linear in it: one row per bone.
    const seen = new Float32Array(4 * joints);
    for (let joint = 0; joint < joints; joint++) {
      for (let c = 0; c < 4; c++) {
        const at = 12 * joint + c;
        seen[4 * joint + c] =
          axis[0] * matrices[at] + axis[1] * matrices[at + 4] + axis[2] * matrices[at + 8];
      }
    }
    let near = Infinity;
    let far = -Infinity;
    for (let i = 0; i < count; i++) {
      const x = shaped[4 * i];
      const y = shaped[4 * i + 1];
      const z = shaped[4 * i + 2];
      let depth = 0;
      let sum = 0;
      for (let a = 4 * i; a < 4 * i + 4; a++) {
        const at = 4 * bones[a];
        sum += shares[a];
        depth += shares[a] * (seen[at] * x + seen[at + 1] * y + seen[at + 2] * z + seen[at + 3]);
      }
      depths[i] = depth / sum;
      if (depths[i] < near) near = depths[i];
      if (depths[i] > far) far = depths[i];
    }
    starts.fill(0);
    const scale = 65535 / Math.max(far - near, 1e-9);
    for (let i = 0; i < count; i++) {
      keys[i] = (far - depths[i]) * scale;
      starts[keys[i] + 1]++;
    }
    for (let key = 0; key < 65536; key++) starts[key + 1] += starts[key];
    for (let i = 0; i < count; i++) {
      const first = 4 * starts[keys[i]]++;
      order[first] = order[first + 1] = order[first + 2] = order[first + 3] = i;
    }
  }

  // Draws a pose from a camera: rows of world to camera, and focal lengths and centre in pixels.
  function draw({ matrices, locals }, rows, lens) {
    shape(locals);
    sort(matrices, rows);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.activeTexture(gl.TEXTURE5);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, across, tableRows, gl.RGBA, gl.FLOAT, shaped);
    gl.activeTexture(gl.TEXTURE3);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 3, joints, gl.RGBA, gl.FLOAT, matrices);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, order);
    gl.uniform4fv(uniform("camera"), rows.flat());
    gl.uniform4fv(uniform("lens"), lens);
    gl.uniform2f(uniform("size"), canvas.width, canvas.height);
    gl.uniform1f(uniform("tint"), state.tinted ? 1 : 0);
    gl.uniform1fv(uniform("light"), person.light.flat().map((x) => state.light * x));
    gl.drawElements(gl.TRIANGLES, corners.length, gl.UNSIGNED_INT, 0);
  }

  // The orbit: the clip's world says where up is, and how the body stands in it says where its front is.
  function stance(clip) {
    let [up, front, middle] = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
    const every = Math.ceil(clip.frames.length / 200);
    for (const frame of clip.frames.filter((_, i) => i % every === 0)) {
      const root = matrixOf(frame.turns.subarray(0, 4));
      const { places } = boneMatrices(frame);
      for (let a = 0; a < 3; a++) {
        up[a] += root[3 * a + 1];
        front[a] += root[3 * a + 2];
        middle[a] += places.slice(0, known).reduce((sum, place) => sum + place[a], 0) / known;
      }
    }
    // Pages of earlier versions do not say: there, the mean of the body's own axis is up.
    up = normalised(clip.up ?? up);
    const level = dot(front, up);
    front = front.map((x, a) => x - level * up[a]);
    // A body that turns all the way round has no mean front.
    if (Math.hypot(...front) < 1e-3) front = cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]);
    return { up, front: normalised(front), middle: middle.map((x) => x / Math.ceil(clip.frames.length / every)) };
  }

  const lengthOf = (clip) => (clip.frames.length - 1) / clip.fps;
  const home = { turn: 0, tilt: 0.1, distance: 3.2 };
  const state = { ...home, clip: 0, time: 0, playing: true, speed: 1, light: 1, changed: true, tinted: false, bends: {}, pose: null };
  const stances = clips.map(stance);

  function orbit() {
    const { up, front, middle } = stances[state.clip];
    const side = cross(up, front);
    const [c, s] = [Math.cos(state.turn), Math.sin(state.turn)];
    const [ct, st] = [Math.cos(state.tilt), Math.sin(state.tilt)];
    const from = up.map((u, a) => ct * (c * front[a] + s * side[a]) + st * u);
    const eye = middle.map((m, a) => m + state.distance * from[a]);
    const ahead = from.map((x) => -x);
    const right = normalised(cross(ahead, up));
    const down = cross(ahead, right);
    const row = (axis) => [...axis, -dot(axis, eye)];
    // People are taller than wide.
    const focal = 1.1 * Math.min(1.5 * canvas.width, canvas.height);
    return [[right, down, ahead].map(row), [focal, focal, canvas.width / 2, canvas.height / 2]];
  }

  function resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((x) =>
      Math.max(1, Math.round(x * ratio)),
    );
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
      state.changed = true;
    }
  }

  let before = 0;
  let asked = 0;
  function step(now) {
    const clip = clips[state.clip];
    const length = lengthOf(clip);
    if (state.playing && length > 0 && !state.held && !state.pose) {
      const time = state.time + (Math.min(now - before, 100) / 1000) * state.speed;
      state.time = time % length;
      state.changed = true;
      if (time >= length) state.looped?.();
    }
    before = now;
    if (!state.held) resize();
    if (state.changed && !state.held) {
      draw(boneMatrices(state.pose || poseAt(clip, state.time), state.bends), ...orbit());
      state.changed = false;
    }
    asked = requestAnimationFrame(step);
  }

  const change = (values) => Object.assign(state, values, { changed: true });
  const turnBy = (x, y) => {
    change({ turn: state.turn + x, tilt: Math.min(1.5, Math.max(-1.5, state.tilt + y)) });
    state.turned?.();
  };
  const zoomBy = (factor) =>
    change({ distance: Math.min(12, Math.max(0.6, state.distance * factor)) });
  const pointers = new Map();
  const spread = () => {
    const [one, other] = [...pointers.values()];
    return Math.hypot(one.x - other.x, one.y - other.y);
  };
  canvas.onpointerdown = (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  };
  canvas.onpointermove = (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) return;
    const wide = pointers.size === 2 ? spread() : 0;
    const here = { x: event.clientX, y: event.clientY };
    pointers.set(event.pointerId, here);
    if (pointers.size === 1) turnBy((last.x - here.x) * 0.008, (here.y - last.y) * 0.008);
    else if (pointers.size === 2) zoomBy(wide / Math.max(spread(), 1));
  };
  canvas.onpointerup = canvas.onpointercancel = (event) => pointers.delete(event.pointerId);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoomBy(Math.exp(event.deltaY * 0.001));
  }, { passive: false });

  // A pose from outside: rotations of joints about axes, radians, and the shift of the root, metres. Joints that are not
  // named are at rest.
  function pose(rotations, shift = [0, 0, 0]) {
    const turns = new Float32Array(4 * joints);
    for (let joint = 0; joint < joints; joint++) turns[4 * joint] = 1;
    for (const [name, axis] of Object.entries(rotations)) {
      const joint = person.joints.indexOf(name);
      if (joint < 0) throw new Error(`there is no joint "${name}"; there are ${person.joints.join(", ")}`);
      if (axis.length !== 3 || !axis.every(Number.isFinite)) throw new Error(`the rotation of "${name}" is not three numbers`);
      const angle = Math.hypot(...axis);
      const sine = angle > 0 ? Math.sin(angle / 2) / angle : 0;
      turns.set([Math.cos(angle / 2), ...axis.map((x) => sine * x)], 4 * joint);
    }
    if (shift.length !== 3 || !shift.every(Number.isFinite)) throw new Error("the shift is not three numbers");
    change({ pose: { turns, shift: Array.from(shift) } });
  }

  // What keys do to the camera.
  const actions = {
    ArrowLeft: () => turnBy(-0.1, 0),
    ArrowRight: () => turnBy(0.1, 0),
    ArrowUp: () => turnBy(0, 0.1),
    ArrowDown: () => turnBy(0, -0.1),
    "+": () => zoomBy(0.9),
    "-": () => zoomBy(1.1),
  };

  return {
    person,
    clips: clips.map((clip) => ({ name: clip.name, seconds: lengthOf(clip) })),
    guessed: guessed / Math.max(count, 1),
    home,
    state,
    change,
    times,
    pose,
    actions,
    // Draws from now on, or no more.
    start() {
      if (!asked) asked = requestAnimationFrame((now) => step((before = now)));
    },
    stop() {
      cancelAnimationFrame(asked);
      asked = 0;
    },
    // Holds one frame of a clip, from the camera with these rows and lens.
    hold(clip, frame, rows, lens, width, height) {
      state.held = true;
      Object.assign(canvas, { width, height });
      draw(boneMatrices(clips[clip].frames[frame]), rows, lens);
    },
    release: () => change({ held: false }),
    // Gives the memory of the GPU back.
    end() {
      this.stop();
      gl.getExtension("WEBGL_lose_context")?.loseContext();
    },
  };
}
