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

// Triangles of a shape: positions and normals, six numbers per corner.
function shapeMesh(piece) {
  const out = [];
  const push = (p, n) => out.push(...p, ...n);
  const sphere = (radii, shift) => {
    const at = (u, v) => [Math.sin(v) * Math.cos(u), Math.sin(v) * Math.sin(u), Math.cos(v)];
    const corner = (u, v) => {
      const d = at(u, v), n = d.map((x, k) => x / radii[k]), l = Math.hypot(...n);
      push(d.map((x, k) => x * radii[k] + (k === 2 ? shift(d[2]) : 0)), n.map((x) => x / l));
    };
    const U = 20, V = 12;
    for (let i = 0; i < U; i++)
      for (let j = 0; j < V; j++) {
        const a = (2 * Math.PI * i) / U, b = (2 * Math.PI * (i + 1)) / U;
        const c = (Math.PI * j) / V, d = (Math.PI * (j + 1)) / V;
        for (const [u, v] of [[a, c], [a, d], [b, d], [a, c], [b, d], [b, c]]) corner(u, v);
      }
  };
  if (piece.ball) sphere(piece.ball, () => 0);
  else if (piece.capsule) {
    const [r, h] = piece.capsule;
    sphere([r, r, r], (z) => (z > 1e-9 ? h : z < -1e-9 ? -h : 0));
    const U = 20;
    for (let i = 0; i < U; i++) {
      const [a, b] = [i, i + 1].map((k) => [Math.cos((2 * Math.PI * k) / U), Math.sin((2 * Math.PI * k) / U), 0]);
      for (const [d, z] of [[a, -h], [b, -h], [b, h], [a, -h], [b, h], [a, h]]) push([d[0] * r, d[1] * r, z], d);
    }
  } else {
    const flat = [];
    if (piece.box) {
      const [x, y, z] = piece.box;
      for (let axis = 0; axis < 3; axis++)
        for (const side of [-1, 1]) {
          const u = (axis + 1) % 3, v = (axis + 2) % 3;
          const at = (p, q) => {
            const w = [0, 0, 0];
            w[axis] = side; w[u] = p * side; w[v] = q;
            return [w[0] * x, w[1] * y, w[2] * z];
          };
          flat.push(at(-1, -1), at(1, -1), at(1, 1), at(-1, -1), at(1, 1), at(-1, 1));
        }
    } else for (let i = 0; i < piece.hull.length; i += 3) flat.push(piece.hull.slice(i, i + 3));
    for (let i = 0; i < flat.length; i += 3) {
      const [a, b, c] = flat.slice(i, i + 3);
      const e = b.map((x, k) => x - a[k]), g = c.map((x, k) => x - a[k]);
      const n = [e[1] * g[2] - e[2] * g[1], e[2] * g[0] - e[0] * g[2], e[0] * g[1] - e[1] * g[0]];
      const l = Math.hypot(...n) || 1;
      for (const p of [a, b, c]) push(p, n.map((x) => x / l));
    }
  }
  return out;
}

const SOLID_VERTEX = `#version 300 es
in vec3 position; in vec3 normal; in vec4 tint;
uniform mat4 camera; uniform vec4 turn; uniform vec3 place; uniform vec3 eye;
out vec3 n; out vec4 color; out float depth; out vec3 world;
vec3 turned(vec4 q, vec3 v) { return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v); }
void main() {
  world = turned(turn, position) + place; n = turned(turn, normal); color = tint;
  depth = distance(world, eye); gl_Position = camera * vec4(world, 1.0);
}`;
const LEAST_DETAIL = 0.25;
const SOLID_FRAGMENT = `#version 300 es
precision highp float;
in vec3 n; in vec4 color; in float depth; in vec3 world;
uniform vec3 paint; uniform float painted; uniform float cut; uniform vec3 sky; uniform vec3 eye; uniform float far;
out vec4 pixel;
void main() {
  vec3 m = normalize(n);
  if (painted < 0.5) {
    if (depth < cut && m.z < 0.8) discard;
    if (dot(m, eye - world) < 0.0) discard;
  }
  vec3 base = painted > 0.5 ? paint : color.rgb;
  vec3 light = normalize(vec3(0.35, -0.55, 0.9));
  float lit = 0.7 + 0.1 * m.z + 0.26 * max(dot(m, light), 0.0);
  vec3 half_way = normalize(light + normalize(eye - world));
  float gloss = painted > 0.5 ? 0.18 * pow(max(dot(m, half_way), 0.0), 24.0) : 0.0;
  float fog = painted > 0.5 ? 0.0 : smoothstep(0.55, 1.0, depth / far);
  pixel = vec4(mix(base * lit + gloss, sky, fog), 1.0);
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
  ["position", "normal", "tint"].forEach((name, k) => gl.bindAttribLocation(program, k, name));
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

const CONTACT = [0.86, 0.08, 0.24], KIND = { driven: [0.27, 0.47, 0.67], simulated: [0.93, 0.68, 0.25] };
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
    this.time = 0;
    this.playing = false;
    this.speed = 1;
    this.detail = 1;
    this.contacts = true;
    this.drawn = 0;
    this.gl = this.canvas.getContext("webgl2", { antialias: true, alpha: false, preserveDrawingBuffer: true });
    if (!this.gl) {
      root.querySelector(".nowebgl").hidden = false;
      return;
    }
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

  mesh(numbers, tint) {
    const gl = this.gl, array = gl.createVertexArray(), count = numbers.length / 6;
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 24, 0);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 3, gl.FLOAT, false, 24, 12);
    if (tint) {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(tint), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(2);
      gl.vertexAttribPointer(2, 4, gl.FLOAT, false, 16, 0);
    }
    return { array, count };
  }

  // Fixed bodies become one mesh; each piece of a moving body has its own.
  build(scene) {
    const fixed = [], tint = [], pieces = [], cache = new Map();
    scene.bodies.forEach((body, index) => {
      const slot = scene.moving.indexOf(index);
      for (const piece of body.pieces) {
        const { at, ...shape } = piece, key = JSON.stringify(shape);
        if (!cache.has(key)) cache.set(key, { numbers: shapeMesh(piece) });
        const kept = cache.get(key);
        if (slot >= 0) {
          kept.mesh ??= this.mesh(kept.numbers);
          pieces.push({ slot, body: index, kind: body.kind, mesh: kept.mesh, q: at.slice(3), p: at.slice(0, 3) });
          continue;
        }
        const [q, p] = compose(body.at.slice(3), body.at.slice(0, 3), at.slice(3), at.slice(0, 3));
        const shade = 0.9 + 0.1 * ((index * 0.618) % 1);
        for (let i = 0; i < kept.numbers.length; i += 6) {
          const corner = rotate(q, kept.numbers.slice(i, i + 3)).map((v, k) => v + p[k]);
          fixed.push(...corner, ...rotate(q, kept.numbers.slice(i + 3, i + 6)));
          tint.push(shade, 0, 0, index);
        }
      }
    });
    this.pieces = pieces;
    this.fixed = { numbers: fixed, tint };
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
    const tint = this.fixed.tint.slice();
    for (let i = 0; i < tint.length; i += 4) {
      const shade = tint[i];
      for (let k = 0; k < 3; k++) tint[i + k] = solid[k] * shade;
    }
    this.room = this.mesh(this.fixed.numbers, tint);
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

  panels() {
    const n = this.scene.engines.length, columns = this.canvas.clientWidth >= 900 ? n : Math.min(n, 2);
    return { columns, rows: Math.ceil(n / columns) };
  }

  draw() {
    const gl = this.gl;
    if (!gl || !this.scene || !this.room) return;
    const scale = Math.min(window.devicePixelRatio || 1, 2) * (this.playing ? this.detail : 1);
    const width = Math.round(this.canvas.clientWidth * scale), height = Math.round(this.canvas.clientHeight * scale);
    if (!width || !height) return;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    const { columns, rows } = this.panels();
    this.labels.dataset.columns = columns;
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(...this.edge, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.SCISSOR_TEST);
    gl.enable(gl.DEPTH_TEST);
    this.scene.engines.forEach((one, k) => {
      const w = Math.floor(width / columns), h = Math.floor(height / rows);
      const x = (k % columns) * w, y = height - (Math.floor(k / columns) + 1) * h;
      const gap = Math.max(1, Math.round(scale));
      const cell = [x, y, w - (k % columns < columns - 1 ? gap : 0), h - (Math.floor(k / columns) ? 0 : gap * (rows > 1))];
      gl.viewport(...cell);
      gl.scissor(...cell);
      gl.clearColor(...this.sky, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      this.drawEngine(one, this.camera(cell[2] / cell[3]), scale);
    });
    this.drawn++;
  }

  drawEngine(one, camera, scale) {
    const gl = this.gl, { program, at } = this.solid;
    const frame = Math.min(Math.round(this.time), one.f - 1);
    gl.useProgram(program);
    gl.uniformMatrix4fv(at.camera, false, camera.matrix);
    gl.uniform3fv(at.eye, camera.eye);
    gl.uniform3fv(at.sky, this.sky);
    gl.uniform1f(at.far, this.view.distance + 9);
    gl.uniform1f(at.cut, this.view.distance - this.cutBy);
    gl.uniform1f(at.painted, 0);
    gl.uniform4f(at.turn, 1, 0, 0, 0);
    gl.uniform3f(at.place, 0, 0, 0);
    gl.bindVertexArray(this.room.array);
    gl.drawArrays(gl.TRIANGLES, 0, this.room.count);
    gl.uniform1f(at.painted, 1);
    let last = -1, turn, place;
    for (const piece of this.pieces) {
      if (piece.slot !== last) [turn, place] = this.pose(one, (last = piece.slot), this.time);
      const [q, p] = compose(turn, place, piece.q, piece.p);
      const code = one.depth[piece.body * one.f + frame];
      const share = code ? Math.min(1, 0.25 + Math.max(0, (code - 40) / 160)) : 0;
      gl.uniform3fv(at.paint, KIND[piece.kind].map((v, k) => v * (1 - share) + OVERLAP[k] * share));
      gl.uniform4fv(at.turn, q);
      gl.uniform3fv(at.place, p);
      gl.bindVertexArray(piece.mesh.array);
      gl.drawArrays(gl.TRIANGLES, 0, piece.mesh.count);
    }
    if (this.contacts) this.drawContacts(one, camera, frame, scale);
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

  // Lower the resolution of a player that does not reach 50 frames a second; a still picture has all pixels.
  adapt(passed) {
    this.pace = this.pace === undefined ? passed : 0.8 * this.pace + 0.2 * passed;
    this.settled = (this.settled ?? 0) + 1;
    if (this.settled < 6 || this.pace <= 20 || this.detail <= LEAST_DETAIL) return;
    this.detail = Math.max(LEAST_DETAIL, this.detail * 0.8);
    this.settled = 0;
  }

  seek(frame) {
    this.time = frame;
    this.show();
  }

  play(on = !this.playing) {
    this.playing = on;
    const button = this.root.querySelector("[data-do=play]");
    button.textContent = on ? "Pause" : "Play";
    button.setAttribute("aria-pressed", on);
    if (!on) this.draw();
  }

  show() {
    const frame = Math.round(this.time);
    this.scrubber.value = frame;
    this.scrubber.setAttribute("aria-valuetext", `${(frame / this.scene.rate).toFixed(3)} s`);
    this.clock.textContent = `${(frame / this.scene.rate).toFixed(3)} s · frame ${frame} of ${this.frames - 1}`;
    this.scene.engines.forEach((one, k) => {
      const at = Math.min(frame, one.f - 1), count = one.first[at + 1] - one.first[at];
      const ended = frame > one.f - 1 ? ` · ended: ${one.ended}` : "";
      this.labels.children[k].lastChild.textContent =
        `overlap ${millimetres(one.deepest[at])} · ${count} contact${count === 1 ? "" : "s"}${ended}`;
    });
    const cursor = this.root.querySelector(".cursor");
    if (cursor) cursor.setAttribute("transform", `translate(${this.strip.x(frame)} 0)`);
    this.draw();
  }

  // Labels of the panels, the strip of overlap over time, and the buttons that jump.
  describe() {
    this.labels.replaceChildren(...this.scene.engines.map((one) => {
      const label = document.createElement("div"), name = document.createElement("b"), told = document.createElement("span");
      name.textContent = `${one.engine} ${one.profile}`;
      name.dataset.engine = one.engine;
      label.append(name, told);
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
    const deepest = this.scene.engines.filter((one) => one.worst_depth > 0);
    jumps.replaceChildren(...deepest.map((one) =>
      jump(`Worst overlap ${one.engine}: ${millimetres(one.worst_depth)} at ${time(one.worst)}`, one.worst, one.worst_at)));
    if (this.scene.apart.length) {
      const frame = this.scene.apart_frame;
      jumps.append(jump(
        `Largest disagreement: ${this.scene.apart_body}, ${metres(this.scene.apart[frame])} at ${time(frame)}`, frame, null));
    }
    this.strip = strip(this.root.querySelector(".strip"), this.scene, this.frames, this.colors);
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
    this.scrubber.addEventListener("input", () => (this.play(false), this.seek(Number(this.scrubber.value))));
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

const metres = (value) => (value < 0.1 ? millimetres(value) : `${value.toPrecision(3)} m`);
const millimetres = (value) => {
  const mm = value * 1000;
  return mm < 1e-4 ? "0 mm" : mm < 0.01 ? `${(mm * 1000).toPrecision(2)} µm` : `${mm.toPrecision(3)} mm`;
};

// Overlap of every engine over time on a logarithmic axis; a click moves the clock.
function strip(svg, scene, frames, colors) {
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
  scene.engines.forEach((one) => svg.append(make("path", { d: path(one.deepest), class: "line", "data-engine": one.engine })));
  const cursor = make("g", { class: "cursor" });
  cursor.append(make("line", { x1: 0, x2: 0, y1: top, y2: H - bottom }));
  svg.append(cursor);
  const go = (event) => {
    const box = svg.getBoundingClientRect();
    const share = ((event.clientX - box.left) / box.width * W - left) / (W - left - 16);
    window.touchstone.player.play(false);
    window.touchstone.player.seek(Math.round(Math.min(1, Math.max(0, share)) * (frames - 1)));
  };
  svg.onpointerdown = (event) => (svg.setPointerCapture(event.pointerId), go(event));
  svg.onpointermove = (event) => event.buttons && go(event);
  return { x };
}
