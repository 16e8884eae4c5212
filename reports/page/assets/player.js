// Playback of one scene on several engines: one WebGL canvas with a panel per engine, one camera, one clock.
"use strict";

async function inflate(text) {
  const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Block of an engine as arrays; the layout is that of playback.py.
async function unpackEngine(one, scene) {
  const bytes = await inflate(one.data);
  const f = one.frames, m = scene.moving.length, n = scene.bodies.length, c = one.contacts;
  const view = new DataView(bytes.buffer);
  let at = 0;
  const int16 = (count) => {
    const out = new Int16Array(count);
    for (let i = 0; i < count; i++, at += 2) out[i] = view.getInt16(at, true);
    return out;
  };
  const pose = int16(7 * m * f);
  for (let row = 0; row < 7 * m; row++)
    for (let i = 1; i < f; i++) pose[row * f + i] += pose[row * f + i - 1];
  const depth = bytes.slice(at, at + n * f);
  at += n * f;
  const deepest = new Float32Array(f);
  for (let i = 0; i < f; i++, at += 4) deepest[i] = view.getFloat32(at, true);
  const first = new Int32Array(f + 1);
  for (let i = 0; i < f; i++, at += 2) first[i + 1] = first[i] + view.getUint16(at, true);
  return { ...one, f, pose, depth, deepest, first, contact: int16(7 * c), c };
}

const mul = (a, b) => {
  const out = new Float32Array(16);
  for (let col = 0; col < 4; col++)
    for (let row = 0; row < 4; row++)
      for (let k = 0; k < 4; k++) out[col * 4 + row] += a[k * 4 + row] * b[col * 4 + k];
  return out;
};
const rotate = (q, v) => {
  const [w, x, y, z] = q;
  const tx = 2 * (y * v[2] - z * v[1]), ty = 2 * (z * v[0] - x * v[2]), tz = 2 * (x * v[1] - y * v[0]);
  return [v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx];
};
const times = (a, b) => [
  a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
  a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
  a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
  a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
];
const compose = (q, p, r, s) => [times(q, r), rotate(q, s).map((v, k) => v + p[k])];

// Corners of a shape, six numbers each (position and normal), and the corners of its triangles: `fine`, and `coarse`
// for players that are late.
function shapeMesh(piece) {
  if (piece.ball) return roundMesh(piece.ball, 0);
  if (piece.capsule) return roundMesh(Array(3).fill(piece.capsule[0]), piece.capsule[1]);
  if (piece.cylinder) return cylinderMesh(...piece.cylinder, piece.cylinder[0]);
  if (piece.cone) return cylinderMesh(...piece.cone, 0);
  const flat = piece.box ? boxCorners(piece.box) : [], corners = [];
  for (let i = 0; i < (piece.hull ?? []).length; i += 3) flat.push(piece.hull.slice(i, i + 3));
  for (let i = 0; i < flat.length; i += 3) {
    const [a, b, c] = flat.slice(i, i + 3);
    const e = b.map((x, k) => x - a[k]), g = c.map((x, k) => x - a[k]);
    const n = [e[1] * g[2] - e[2] * g[1], e[2] * g[0] - e[0] * g[2], e[0] * g[1] - e[1] * g[0]];
    const l = Math.hypot(...n) || 1;
    for (const p of [a, b, c]) corners.push(...p, ...n.map((x) => x / l));
  }
  const fine = flat.map((_, k) => k);
  return { corners, fine, coarse: fine };
}

// An ellipsoid, cut in two and moved apart by twice `half_length` for a capsule.
function roundMesh(radii, half_length) {
  const U = 20, V = 12, corners = [], rings = [];
  const ring = (j, shift) => {
    rings.push({ j, first: corners.length / 6 });
    for (let i = 0; i <= U; i++) {
      const u = (2 * Math.PI * i) / U, v = (Math.PI * j) / V;
      const d = [Math.sin(v) * Math.cos(u), Math.sin(v) * Math.sin(u), Math.cos(v)];
      const n = d.map((x, k) => x / radii[k]), l = Math.hypot(...n);
      corners.push(d[0] * radii[0], d[1] * radii[1], d[2] * radii[2] + shift, ...n.map((x) => x / l));
    }
  };
  for (let j = 0; j <= V; j++) {
    ring(j, j > V / 2 ? -half_length : half_length);
    if (half_length && j === V / 2) ring(j, -half_length);
  }
  const triangles = (step) => {
    const kept = rings.filter(({ j }) => j % step === 0), found = [];
    for (let k = 1; k < kept.length; k++)
      for (let i = 0; i < U; i += step) {
        const a = kept[k - 1].first + i, b = kept[k].first + i;
        found.push(a, b, b + step, a, b + step, a + step);
      }
    return found;
  };
  return { corners, fine: triangles(1), coarse: triangles(2) };
}

// A cylinder along z, or a cone if the radius `top` of its upper cap is 0: two caps and a side whose corners share
// normals.
function cylinderMesh(radius, half_length, top) {
  const U = 20, corners = [], slant = Math.hypot(radius - top, 2 * half_length);
  const rise = (radius - top) / slant, out = (2 * half_length) / slant;
  // rings from the upper cap's centre over both rims to the lower cap's centre: radius, height, normal
  for (const [r, z, side, up] of [[0, 1, 0, 1], [top, 1, 0, 1], [top, 1, out, rise], [radius, -1, out, rise],
    [radius, -1, 0, -1], [0, -1, 0, -1]])
    for (let i = 0; i <= U; i++) {
      const u = (2 * Math.PI * i) / U;
      corners.push(r * Math.cos(u), r * Math.sin(u), z * half_length, side * Math.cos(u), side * Math.sin(u), up);
    }
  const triangles = (step) => {
    const found = [];
    for (const k of [0, 2, 4])
      for (let i = 0; i < U; i += step) {
        const a = k * (U + 1) + i, b = a + U + 1;
        found.push(a, b, b + step, a, b + step, a + step);
      }
    return found;
  };
  return { corners, fine: triangles(1), coarse: triangles(2) };
}

function boxCorners(half) {
  const found = [];
  for (let axis = 0; axis < 3; axis++)
    for (const side of [-1, 1]) {
      const u = (axis + 1) % 3, v = (axis + 2) % 3;
      const at = (p, q) => {
        const w = [0, 0, 0];
        w[axis] = side; w[u] = p * side; w[v] = q;
        return w.map((x, k) => x * half[k]);
      };
      found.push(at(-1, -1), at(1, -1), at(1, 1), at(-1, -1), at(1, 1), at(-1, 1));
    }
  return found;
}

const LEAST_DETAIL = 0.25;
const TRIAL = 15;
const HELPS = 0.95;
const SAMPLES = 4;
const TEXT_INTERVAL = 100;
const LIGHT = `const vec3 light = vec3(0.3149, -0.4949, 0.8099);
float lit_by(vec3 m) { return 0.7 + 0.1 * m.z + 0.26 * max(dot(m, light), 0.0); }`;
// Fixed bodies: walls towards the viewer and tops over what it looks at are cut away, and what is far fades.
const ROOM_VERTEX = `#version 300 es
in vec3 position; in vec3 normal; in vec3 tint;
uniform mat4 camera; uniform vec3 eye;
out vec3 n; out vec3 color; out vec3 back;
${LIGHT}
void main() {
  back = eye - position; n = normal; color = tint * lit_by(normal); gl_Position = camera * vec4(position, 1.0);
}`;
const ROOM_FRAGMENT = `#version 300 es
precision highp float;
in vec3 n; in vec3 color; in vec3 back;
uniform float cut; uniform float over; uniform vec3 sky; uniform float far;
out vec4 pixel;
void main() {
  float depth = length(back);
  if (dot(n, back) < 0.0 || (depth < cut && (n.z < 0.8 || back.z < over))) discard;
  pixel = vec4(mix(color, sky, smoothstep(0.55, 1.0, depth / far)), 1.0);
}`;
// All pieces of moving bodies of one engine in one call: each corner finds the pose and colour of its piece in a texture.
const SOLID_VERTEX = `#version 300 es
in vec3 position; in vec3 normal; in float piece;
uniform mat4 camera; uniform vec3 eye; uniform highp sampler2D poses; uniform int engine;
out vec3 n; out vec3 color; out vec3 back;
vec3 turned(vec4 q, vec3 v) { return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v); }
void main() {
  ivec2 at = ivec2(3 * engine, int(piece));
  vec4 turn = texelFetch(poses, at, 0);
  vec3 world = turned(turn, position) + texelFetch(poses, at + ivec2(1, 0), 0).xyz;
  color = texelFetch(poses, at + ivec2(2, 0), 0).rgb;
  n = turned(turn, normal); back = eye - world; gl_Position = camera * vec4(world, 1.0);
}`;
const SOLID_FRAGMENT = `#version 300 es
precision highp float;
in vec3 n; in vec3 color; in vec3 back;
out vec4 pixel;
${LIGHT}
void main() {
  vec3 m = normalize(n);
  float shine = max(dot(m, normalize(light + normalize(back))), 0.0);
  float two = shine * shine, eight = two * two * two * two;
  pixel = vec4(color * lit_by(m) + 0.18 * eight * eight * eight, 1.0);
}`;
const MARK_VERTEX = `#version 300 es
in vec3 position; uniform mat4 camera; uniform float size;
void main() { gl_Position = camera * vec4(position, 1.0); gl_Position.z -= 0.0005; gl_PointSize = size; }`;
const MARK_FRAGMENT = `#version 300 es
precision mediump float; uniform vec3 paint; uniform float round; out vec4 pixel;
void main() {
  float r = length(gl_PointCoord - 0.5);
  if (round > 0.5 && r > 0.5) discard;
  pixel = vec4(round > 0.5 && r > 0.34 ? vec3(1.0) : paint, 1.0);
}`;

function programOf(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  ["position", "normal", "tint", "piece"].forEach((name, k) => gl.bindAttribLocation(program, k, name));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const at = {};
  const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
  for (let k = 0; k < count; k++) {
    const { name } = gl.getActiveUniform(program, k);
    at[name] = gl.getUniformLocation(program, name);
  }
  return { program, at };
}

const MOST_BESIDE = 5; // panels beside each other on a wide screen
const CONTACT = [0.86, 0.08, 0.24];
const KIND = { driven: [0.27, 0.47, 0.67], prescribed: [0.55, 0.48, 0.67], simulated: [0.93, 0.68, 0.25] };
const OVERLAP = [0.8, 0.1, 0.35];

class Player {
  constructor(root, scenes, colors) {
    this.root = root;
    this.scenes = scenes;
    this.colors = colors;
    this.canvas = root.querySelector("canvas");
    this.labels = root.querySelector(".labels");
    this.scrubber = root.querySelector("[name=frame]");
    this.clock = root.querySelector(".clock");
    this.cursor = root.querySelector(".cursor");
    this.time = 0;
    this.playing = false;
    this.speed = 1;
    this.detail = 1;
    this.contacts = true;
    this.drawn = 0;
    // Still pictures are smoothed in a buffer of their own (`smoothly`): samples and copies of each frame take longer
    // than all else where there is no graphics processor. Pixels are read in the task that drew them.
    this.gl = this.canvas.getContext("webgl2", { antialias: false, alpha: false });
    if (!this.gl) {
      root.querySelector(".nowebgl").hidden = false;
      return;
    }
    this.plain = programOf(this.gl, ROOM_VERTEX, ROOM_FRAGMENT);
    this.solid = programOf(this.gl, SOLID_VERTEX, SOLID_FRAGMENT);
    this.mark = programOf(this.gl, MARK_VERTEX, MARK_FRAGMENT);
    this.marks = this.gl.createBuffer();
    this.markArray = this.gl.createVertexArray();
    this.listen();
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    requestAnimationFrame((now) => this.tick(now));
  }

  async open(name, frame = 0) {
    const text = this.scenes[name];
    if (!text || !this.gl) return false;
    const scene = JSON.parse(new TextDecoder().decode(await inflate(text)));
    scene.engines = await Promise.all(scene.engines.map((one) => unpackEngine(one, scene)));
    this.build(scene);
    this.scene = scene;
    this.frames = Math.max(...scene.engines.map((one) => one.f));
    this.scrubber.max = this.frames - 1;
    this.resetCamera();
    this.describe();
    this.seek(Math.min(Math.max(frame, 0), this.frames - 1));
    return true;
  }

  // A vertex array of buffers: [location, numbers per corner, values] each.
  vertices(buffers) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    for (const [location, size, values] of buffers) {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, gl.FLOAT, false, 0, 0);
    }
    return array;
  }

  // Fixed bodies become one mesh, and so do all pieces of moving bodies, whose corners bear the piece's number.
  build(scene) {
    const gl = this.gl, fixed = { place: [], normal: [], shade: [] }, solid = { place: [], normal: [], piece: [] };
    const pieces = [], fine = [], coarse = [], cache = new Map();
    scene.bodies.forEach((body, index) => {
      const slot = scene.moving.indexOf(index);
      for (const piece of body.pieces) {
        const { at, ...shape } = piece, key = JSON.stringify(shape);
        if (!cache.has(key)) cache.set(key, shapeMesh(piece));
        const mesh = cache.get(key), corner = (k) => mesh.corners.slice(6 * k, 6 * k + 3);
        const normal = (k) => mesh.corners.slice(6 * k + 3, 6 * k + 6);
        if (slot >= 0) {
          const first = solid.piece.length;
          for (let k = 0; k < mesh.corners.length / 6; k++) {
            solid.place.push(...corner(k));
            solid.normal.push(...normal(k));
            solid.piece.push(pieces.length);
          }
          for (const k of mesh.fine) fine.push(first + k);
          for (const k of mesh.coarse) coarse.push(first + k);
          pieces.push({ slot, body: index, kind: body.kind, q: at.slice(3), p: at.slice(0, 3) });
          continue;
        }
        const [q, p] = compose(body.at.slice(3), body.at.slice(0, 3), at.slice(3), at.slice(0, 3));
        const shade = 0.9 + 0.1 * ((index * 0.618) % 1);
        for (const k of mesh.fine) {
          fixed.place.push(...rotate(q, corner(k)).map((v, c) => v + p[c]));
          fixed.normal.push(...rotate(q, normal(k)));
          fixed.shade.push(shade);
        }
      }
    });
    this.pieces = pieces;
    this.fixed = fixed;
    const array = this.vertices([[0, 3, solid.place], [1, 3, solid.normal], [3, 1, solid.piece]]);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array([...fine, ...coarse]), gl.STATIC_DRAW);
    this.moving = { array, fine: [0, fine.length], coarse: [4 * fine.length, coarse.length] };
    this.poses = new Float32Array(12 * scene.engines.length * Math.max(1, pieces.length));
    this.poseTexture ??= gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.poseTexture);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    this.theme();
  }

  theme() {
    const style = getComputedStyle(document.documentElement);
    const parse = (name) => {
      const text = style.getPropertyValue(name).trim().replace("#", "");
      return [0, 2, 4].map((k) => parseInt(text.slice(k, k + 2), 16) / 255);
    };
    this.sky = parse("--stage");
    this.edge = parse("--line");
    const solid = parse("--solid");
    if (!this.fixed) return;
    const tint = this.fixed.shade.flatMap((shade) => solid.map((value) => value * shade));
    const array = this.vertices([[0, 3, this.fixed.place], [1, 3, this.fixed.normal], [2, 3, tint]]);
    this.room = { array, count: this.fixed.shade.length };
    this.draw();
  }

  resetCamera() {
    const { middle, size } = this.scene;
    this.view = { yaw: -0.95, pitch: 0.42, distance: Math.max(0.7, size * 3.4), target: [...middle] };
    this.home = structuredClone(this.view);
    this.cutBy = Math.max(0.35, size * 1.15);
  }

  pose(one, slot, time) {
    const f = one.f, i = Math.min(Math.floor(time), f - 1), j = Math.min(i + 1, f - 1), w = Math.min(time, f - 1) - i;
    const m = this.scene.moving.length, at = (c, k) => one.pose[(c * m + slot) * f + k];
    const p = [0, 1, 2].map((c) => (at(c, i) * (1 - w) + at(c, j) * w) * this.scene.step + this.scene.middle[c]);
    const q = [3, 4, 5, 6].map((c) => at(c, i) * (1 - w) + at(c, j) * w);
    const l = Math.hypot(...q) || 1;
    return [q.map((x) => x / l), p];
  }

  camera(aspect) {
    const { yaw, pitch, distance, target } = this.view;
    const back = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
    const eye = target.map((v, k) => v + back[k] * distance);
    const right = [-Math.sin(yaw), Math.cos(yaw), 0];
    const up = [-Math.sin(pitch) * Math.cos(yaw), -Math.sin(pitch) * Math.sin(yaw), Math.cos(pitch)];
    const dot = (a) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
    const look = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
      dot(right), dot(up), dot(back), 1];
    const f = 1 / Math.tan(0.3) * Math.min(1, aspect * 1.1), near = 0.02 * distance, far = 60 + 10 * distance;
    const lens = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0,
      (2 * far * near) / (near - far), 0];
    return { matrix: mul(lens, look), eye, right, up };
  }

  // Numbers of the engines that have a panel: those that are ticked beside the matrix, or all.
  shown() {
    const all = this.scene.engines.map((_, k) => k);
    const found = all.filter((k) => !window.touchstone.hidden?.has(this.scene.engines[k].engine));
    return found.length ? found : all;
  }

  choose() {
    if (!this.scene) return;
    this.describe();
    this.show();
  }

  panels() {
    const n = this.shown().length, most = this.canvas.clientWidth >= 900 ? MOST_BESIDE : 2;
    const rows = Math.ceil(n / most);
    return { columns: Math.ceil(n / rows), rows };
  }

  draw() {
    const gl = this.gl;
    if (!gl || !this.scene || !this.room) return;
    const late = this.playing && this.detail < 1;
    const scale = Math.min(window.devicePixelRatio || 1, 2) * (late ? this.detail : 1);
    const width = Math.round(this.canvas.clientWidth * scale), height = Math.round(this.canvas.clientHeight * scale);
    if (!width || !height) return;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    this.place();
    if (late) this.drawPanels(width, height, scale);
    else this.smoothly(width, height, () => this.drawPanels(width, height, scale));
    this.drawn++;
  }

  // Draw with SAMPLES samples per pixel, in a buffer that is then copied; where that fails, without.
  smoothly(width, height, draw) {
    const gl = this.gl, size = `${width} ${height}`;
    if (this.smooth?.size !== size) {
      for (const one of this.smooth?.buffers ?? []) gl.deleteRenderbuffer(one);
      const frame = this.smooth?.frame ?? gl.createFramebuffer(), buffers = [];
      gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
      for (const [format, point] of [[gl.RGB8, gl.COLOR_ATTACHMENT0], [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]]) {
        buffers.push(gl.createRenderbuffer());
        gl.bindRenderbuffer(gl.RENDERBUFFER, buffers.at(-1));
        gl.renderbufferStorageMultisample(gl.RENDERBUFFER, SAMPLES, format, width, height);
        gl.framebufferRenderbuffer(gl.FRAMEBUFFER, point, gl.RENDERBUFFER, buffers.at(-1));
      }
      this.smooth = { size, frame, buffers, checked: false };
    }
    if (!this.smooth.fails) {
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.smooth.frame);
      draw();
      gl.disable(gl.SCISSOR_TEST);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
      gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
      if (!this.smooth.checked) this.smooth.fails = gl.getError() !== gl.NO_ERROR;
      this.smooth.checked = true;
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    if (this.smooth.fails) draw();
  }

  drawPanels(width, height, scale) {
    const gl = this.gl, { columns, rows } = this.panels();
    this.labels.dataset.columns = columns;
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(...this.edge, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.SCISSOR_TEST);
    gl.enable(gl.DEPTH_TEST);
    this.shown().forEach((number, k) => {
      const column = k % columns, row = Math.floor(k / columns), gap = Math.max(1, Math.round(scale));
      const x = Math.round((column * width) / columns), right = Math.round(((column + 1) * width) / columns);
      const h = Math.floor(height / rows), y = height - (row + 1) * h;
      const cell = [x, y, right - x - (column < columns - 1 ? gap : 0), h - (row ? 0 : gap * (rows > 1))];
      gl.viewport(...cell);
      gl.scissor(...cell);
      gl.clearColor(...this.sky, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      this.drawEngine(this.scene.engines[number], number, this.camera(cell[2] / cell[3]), scale);
    });
  }

  // Poses and colours of all pieces on all engines, three texels each: quaternion, place, colour.
  place() {
    const gl = this.gl, wide = this.scene.engines.length;
    this.scene.engines.forEach((one, k) => {
      const frame = Math.min(Math.round(this.time), one.f - 1);
      let last = -1, turn, place;
      this.pieces.forEach((piece, row) => {
        if (piece.slot !== last) [turn, place] = this.pose(one, (last = piece.slot), this.time);
        const [q, p] = compose(turn, place, piece.q, piece.p), at = 12 * (row * wide + k);
        const code = one.depth[piece.body * one.f + frame];
        const share = alarm(code, this.scene.alarm);
        this.poses.set(q, at);
        this.poses.set(p, at + 4);
        this.poses.set(KIND[piece.kind].map((v, c) => v * (1 - share) + OVERLAP[c] * share), at + 8);
      });
    });
    gl.bindTexture(gl.TEXTURE_2D, this.poseTexture);
    const size = [3 * wide, this.poses.length / (12 * wide)];
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, ...size, 0, gl.RGBA, gl.FLOAT, this.poses);
  }

  drawEngine(one, number, camera, scale) {
    const gl = this.gl;
    const use = ({ program, at }) => {
      gl.useProgram(program);
      gl.uniformMatrix4fv(at.camera, false, camera.matrix);
      gl.uniform3fv(at.eye, camera.eye);
      return at;
    };
    const room = use(this.plain);
    gl.uniform3fv(room.sky, this.sky);
    gl.uniform1f(room.far, this.view.distance + 9);
    gl.uniform1f(room.cut, this.view.distance - this.cutBy);
    gl.uniform1f(room.over, this.view.distance * Math.sin(this.view.pitch));
    gl.bindVertexArray(this.room.array);
    gl.drawArrays(gl.TRIANGLES, 0, this.room.count);
    const solid = use(this.solid), [first, count] = this.playing && this.detail < 1 ? this.moving.coarse : this.moving.fine;
    gl.uniform1i(solid.engine, number);
    gl.bindVertexArray(this.moving.array);
    gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, first);
    if (this.contacts) this.drawContacts(one, camera, Math.min(Math.round(this.time), one.f - 1), scale);
  }

  drawContacts(one, camera, frame, scale) {
    const gl = this.gl, { program, at } = this.mark, points = [], lines = [];
    for (let i = one.first[frame]; i < one.first[frame + 1]; i++) {
      const value = (k) => one.contact[k * one.c + i];
      const p = [0, 1, 2].map((k) => value(k) * this.scene.step + this.scene.middle[k]);
      const reach = (0.015 + 0.02 * (value(6) / 1000)) * this.view.distance * 0.6;
      points.push(...p);
      lines.push(...p, ...[0, 1, 2].map((k) => p[k] + (value(k + 3) / 32767) * reach));
    }
    if (!points.length) return;
    gl.useProgram(program);
    gl.uniformMatrix4fv(at.camera, false, camera.matrix);
    gl.uniform3fv(at.paint, CONTACT);
    gl.bindVertexArray(this.markArray);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.marks);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 12, 0);
    gl.disable(gl.DEPTH_TEST);
    for (const [numbers, mode, size] of [[lines, gl.LINES, 1], [points, gl.POINTS, 7 * scale]]) {
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.DYNAMIC_DRAW);
      gl.uniform1f(at.size, size);
      gl.uniform1f(at.round, mode === gl.POINTS ? 1 : 0);
      gl.drawArrays(mode, 0, numbers.length / 3);
    }
    gl.enable(gl.DEPTH_TEST);
  }

  tick(now) {
    if (this.playing && this.scene) {
      this.adapt(now - (this.before ?? now));
      const passed = Math.min(0.1, (now - (this.before ?? now)) / 1000);
      this.time += passed * this.scene.rate * this.speed;
      if (this.time > this.frames - 1) this.time = 0;
      this.show();
    }
    this.before = now;
    requestAnimationFrame((next) => this.tick(next));
  }

  // Lower the resolution of a player that does not reach 50 frames a second, as long as that makes frames faster; a
  // still picture has all pixels.
  adapt(passed) {
    const trial = this.trial;
    if (!trial || passed <= 0) return;
    trial.times.push(passed);
    if (trial.times.length < TRIAL) return;
    const pace = trial.times.reduce((sum, one) => sum + one) / TRIAL, { before } = trial;
    this.trial = { times: [], before: { pace, detail: this.detail } };
    if (pace <= 20) return;
    if (before && pace > HELPS * before.pace && before.detail > this.detail) {
      this.detail = before.detail;
      this.trial = null;
    } else this.detail = Math.max(LEAST_DETAIL, this.detail * 0.7);
  }

  seek(frame) {
    this.time = frame;
    this.show();
  }

  play(on = !this.playing) {
    this.playing = on;
    this.trial = on ? { times: [], before: null } : null;
    const button = this.root.querySelector("[data-do=play]");
    button.textContent = on ? "Pause" : "Play";
    button.setAttribute("aria-pressed", on);
    if (!on && this.scene) this.show();
  }

  show() {
    const now = performance.now();
    if (!this.playing || now - (this.written ?? 0) >= TEXT_INTERVAL) {
      this.written = now;
      this.write();
    }
    this.cursor.style.transform = `translateX(${this.strip.share(this.time) * 100}cqw)`;
    this.draw();
  }

  // Clock, scrubber and labels: while playing ten times a second, for the page paints them anew.
  write() {
    const frame = Math.round(this.time);
    this.scrubber.value = frame;
    this.scrubber.setAttribute("aria-valuetext", `${(frame / this.scene.rate).toFixed(3)} s`);
    this.clock.textContent = `${(frame / this.scene.rate).toFixed(3)} s · frame ${frame} of ${this.frames - 1}`;
    this.shown().forEach((number, k) => {
      const one = this.scene.engines[number], at = Math.min(frame, one.f - 1), count = one.first[at + 1] - one.first[at];
      const ended = frame > one.f - 1 ? ` · ended: ${one.ended}` : "";
      this.labels.children[k].lastChild.textContent =
        `overlap ${millimetres(one.deepest[at])} · ${count} contact${count === 1 ? "" : "s"}${ended}`;
    });
  }

  // Labels of the panels, the strip of overlap over time, and the buttons that jump.
  describe() {
    const engines = this.shown().map((k) => this.scene.engines[k]);
    this.canvas.parentNode.dataset.rows = this.panels().rows;
    this.labels.replaceChildren(...engines.map((one) => {
      const label = document.createElement("div"), name = document.createElement("b"), state = document.createElement("span");
      name.textContent = `${one.engine} ${one.profile}`;
      name.dataset.engine = one.engine;
      label.append(name, state);
      return label;
    }));
    const jumps = this.root.querySelector(".jumps");
    const jump = (text, frame, focus) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = text;
      button.dataset.frame = frame;
      button.addEventListener("click", () => {
        this.play(false);
        this.seek(frame);
        if (focus) this.view = { ...this.view, target: [...focus], distance: Math.max(0.5, this.home.distance * 0.45) };
        this.cutBy = focus ? 0.3 : this.cutBy;
        this.draw();
        history.replaceState(null, "", `#play=${this.scene.scene}&frame=${frame}`);
      });
      return button;
    };
    const time = (frame) => `${(frame / this.scene.rate).toFixed(2)} s`;
    const deepest = engines.filter((one) => one.worst_depth > 0);
    jumps.replaceChildren(...deepest.map((one) =>
      jump(`Worst overlap ${one.engine}: ${millimetres(one.worst_depth)} at ${time(one.worst)}`, one.worst, one.worst_at)));
    if (this.scene.apart.length) {
      const frame = this.scene.apart_frame;
      jumps.append(jump(
        `Largest disagreement: ${this.scene.apart_body}, ${metres(this.scene.apart[frame])} at ${time(frame)}`, frame, null));
    }
    this.strip = strip(this.root.querySelector(".strip"), this.scene, engines, this.frames, this.colors);
  }

  listen() {
    const view = () => this.view;
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.drag = event.shiftKey || event.button ? "pan" : "turn";
    });
    this.canvas.addEventListener("pointerup", () => (this.drag = null));
    this.canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    this.canvas.addEventListener("pointermove", (event) => {
      if (!this.drag || !this.scene) return;
      if (this.drag === "turn") {
        view().yaw -= event.movementX * 0.008;
        view().pitch = Math.min(1.5, Math.max(-1.2, view().pitch + event.movementY * 0.008));
      } else {
        const { right, up } = this.camera(1), by = view().distance * 0.0016;
        for (let k = 0; k < 3; k++) view().target[k] += (-right[k] * event.movementX + up[k] * event.movementY) * by;
      }
      this.draw();
    });
    this.canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== this.canvas || !this.scene) return;
      event.preventDefault();
      view().distance = Math.min(60, Math.max(0.15, view().distance * Math.exp(event.deltaY * 0.001)));
      this.draw();
    }, { passive: false });
    this.canvas.addEventListener("dblclick", () => this.scene && (this.resetCamera(), this.draw()));
    this.scrubber.addEventListener("input", () => {
      const frame = Number(this.scrubber.value);
      this.play(false);
      this.seek(frame);
    });
    const actions = {
      play: () => this.play(),
      back: () => (this.play(false), this.seek(Math.max(0, Math.round(this.time) - 1))),
      next: () => (this.play(false), this.seek(Math.min(this.frames - 1, Math.round(this.time) + 1))),
      home: () => (this.resetCamera(), this.draw()),
    };
    for (const [name, action] of Object.entries(actions))
      this.root.querySelector(`[data-do=${name}]`).addEventListener("click", () => this.scene && action());
    this.root.querySelector("[name=speed]").addEventListener("change", (event) => (this.speed = Number(event.target.value)));
    this.root.querySelector("[name=contacts]").addEventListener("change", (event) => {
      this.contacts = event.target.checked;
      this.draw();
    });
    this.root.addEventListener("keydown", (event) => {
      if (!this.scene || event.target.matches("select, [type=range], [type=checkbox], button")) return;
      const keys = { " ": actions.play, ArrowLeft: actions.back, ArrowRight: actions.next, Home: () => this.seek(0), r: actions.home,
        "+": () => ((view().distance *= 0.85), this.draw()), "-": () => ((view().distance /= 0.85), this.draw()) };
      if (!keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    });
  }
}

// Share of the colour of overlap: none below the depth that a reader cares about, all at a hundred times as much.
const alarm = (code, from) => (code < from ? 0 : Math.min(1, 0.4 + (0.6 * (code - from)) / 80));
const metres = (value) => (value < 0.1 ? millimetres(value) : `${value.toPrecision(3)} m`);
const millimetres = (value) => {
  const mm = value * 1000;
  return mm < 1e-4 ? "0 mm" : mm < 0.01 ? `${(mm * 1000).toPrecision(2)} µm` : `${mm.toPrecision(3)} mm`;
};

// Overlap of every engine over time on a logarithmic axis; a click moves the clock.
function strip(svg, scene, engines, frames, colors) {
  const W = 1000, H = 90, left = 62, top = 6, bottom = 16, low = -7, high = 0;
  const x = (frame) => left + ((W - left - 16) * frame) / Math.max(1, frames - 1);
  const y = (depth) => top + (H - top - bottom) * (1 - (Math.min(high, Math.max(low, Math.log10(depth || 1e-9))) - low) / (high - low));
  const make = (name, facts, text) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(facts)) node.setAttribute(key, value);
    if (text) node.textContent = text;
    return node;
  };
  svg.setAttribute("viewBox", `0 0 ${W} ${H}`);
  svg.replaceChildren();
  [[1e-7, "0.1 µm"], [1e-5, "10 µm"], [1e-3, "1 mm"], [1e-1, "10 cm"]].forEach(([depth, text]) => {
    svg.append(make("line", { x1: left, x2: W - 16, y1: y(depth), y2: y(depth), class: "grid" }));
    svg.append(make("text", { x: left - 6, y: y(depth) + 4, "text-anchor": "end" }, text));
  });
  const last = (frames - 1) / scene.rate, every = last > 4 ? 1 : 0.5;
  for (let t = 0; t <= last + 1e-9; t += every)
    svg.append(make("text", { x: x(t * scene.rate), y: H - 2, "text-anchor": "middle" }, `${t} s`));
  const path = (values) => Array.from(values, (v, k) => `${k ? "L" : "M"}${x(k).toFixed(1)} ${y(v).toFixed(1)}`).join("");
  if (scene.apart.length) svg.append(make("path", { d: path(scene.apart), class: "spread" }));
  engines.forEach((one) => svg.append(make("path", { d: path(one.deepest), class: "line", "data-engine": one.engine })));
  const go = (event) => {
    const box = svg.getBoundingClientRect();
    const share = ((event.clientX - box.left) / box.width * W - left) / (W - left - 16);
    window.touchstone.player.play(false);
    window.touchstone.player.seek(Math.round(Math.min(1, Math.max(0, share)) * (frames - 1)));
  };
  svg.onpointerdown = (event) => (svg.setPointerCapture(event.pointerId), go(event));
  svg.onpointermove = (event) => event.buttons && go(event);
  return { share: (frame) => x(frame) / W };
}
