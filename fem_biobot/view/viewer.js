// Interactive views of a report: surfaces that move, coloured by a field, turned by mouse, touch or keys.
//
// Written for this page because it must work from a file and stay small: k3d's snapshot brings 2.6 MB of script and
// a notebook stack, the page that vtk.js exports brings 1.0 MB and has neither states nor times. This is WebGL 2 alone.
// Every view is a figure of class view3d with a JSON script; its arrays are little-endian and in base64.
"use strict";
(() => {
  const NONE = 65535; // a value that is not there: the vertex has the colour of its part

  const VERTEX = `#version 300 es
    precision highp float; precision highp int;
    in vec3 from, to, rest; in float part, valueFrom, valueTo;
    uniform vec3 low, size, middle; uniform float share, gain; uniform mat3 turn; uniform vec3 window;
    uniform int hidden, lines;
    out vec3 seen; out float value; flat out int owner; flat out int lacking;
    void main() {
      vec3 place = low + size * (rest + gain * (mix(from, to, share) - rest));
      seen = turn * (place - middle);
      owner = int(part + 0.5);
      value = mix(valueFrom, valueTo, share) / 65534.0;
      lacking = max(valueFrom, valueTo) > 65534.5 ? 1 : 0;
      // lines lie on surfaces: a little nearer, or they are broken
      gl_Position = vec4(seen.xy * window.xy, -seen.z * window.z - (lines == 1 ? 0.003 : 0.0), 1.0);
      if (((hidden >> owner) & 1) == 1) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float; precision highp int;
    in vec3 seen; in float value; flat in int owner; flat in int lacking;
    uniform sampler2D ramp, palette; uniform vec2 limits; uniform int coloured; uniform int lines;
    out vec4 shown;
    void main() {
      if (lines == 1) { shown = vec4(0.17, 0.19, 0.22, 1.0); return; }
      vec3 colour = texelFetch(palette, ivec2(owner, 0), 0).rgb;
      if (coloured == 1 && lacking == 0) {
        float at = clamp((value - limits.x) / (limits.y - limits.x), 0.0, 1.0);
        colour = texture(ramp, vec2((at * 255.0 + 0.5) / 256.0, 0.5)).rgb;
      }
      vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
      float light = 0.52 + 0.40 * abs(dot(normal, vec3(-0.28, 0.42, 0.86))) + 0.14 * abs(normal.z);
      shown = vec4(colour * min(light, 1.0), 1.0);
    }`;

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const make = (tag, properties = {}, ...children) => {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
  };
  const svg = (tag, attributes) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    return made;
  };
  const number = (value) => Number(value.toPrecision(4)).toString();

  function program(gl) {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text.trim());
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
    return made;
  }

  class Scene {
    // what the graphics card holds of one view, and how a moment of it is drawn
    constructor(canvas, data) {
      const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
      if (!gl) throw new Error("no WebGL 2");
      Object.assign(this, { gl, canvas, data });
      this.program = program(gl);
      this.at = (name) => gl.getUniformLocation(this.program, name);
      this.positions = this.buffer(gl.ARRAY_BUFFER, data.positions);
      this.parts = this.buffer(gl.ARRAY_BUFFER, data.part);
      this.fields = data.fields.map((field) => this.buffer(gl.ARRAY_BUFFER, field.values));
      this.triangles = this.buffer(gl.ELEMENT_ARRAY_BUFFER, data.triangles);
      this.edges = this.buffer(gl.ELEMENT_ARRAY_BUFFER, data.edges);
      this.ramps = data.fields.map((field) => this.texture(bytes(field.ramp)));
      this.palette = this.texture(new Uint8Array(data.parts.flatMap((p) => p.colour)));
      this.low = data.low;
      this.size = data.high.map((h, i) => h - data.low[i]);
      this.middle = data.high.map((h, i) => (h + data.low[i]) / 2);
      this.reach = Math.hypot(...this.size) / 2 || 1;
    }
    fit(camera) {
      // the window that holds the box of all moments, with a margin
      const [right, up] = camera.axes(), half = (row) => row.reduce((sum, r, i) => sum + Math.abs(r) * this.size[i], 0) / 2;
      const aspect = this.canvas.clientWidth / (this.canvas.clientHeight || 1) || 1;
      return (1.06 * Math.max(half(up), half(right) / aspect)) / this.reach;
    }
    buffer(target, text) {
      const gl = this.gl, made = gl.createBuffer();
      gl.bindBuffer(target, made);
      gl.bufferData(target, bytes(text), gl.STATIC_DRAW);
      return made;
    }
    texture(colours) {
      const gl = this.gl, made = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, made);
      gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, colours.length / 3, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, colours);
      for (const name of ["MIN_FILTER", "MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_2D, gl["TEXTURE_" + name], gl.NEAREST);
      for (const name of ["WRAP_S", "WRAP_T"]) gl.texParameteri(gl.TEXTURE_2D, gl["TEXTURE_" + name], gl.CLAMP_TO_EDGE);
      return made;
    }
    attribute(name, buffer, count, kind, normalised, offset) {
      const gl = this.gl, place = gl.getAttribLocation(this.program, name);
      if (place < 0) return;
      gl.enableVertexAttribArray(place);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.vertexAttribPointer(place, count, kind, normalised, 0, offset);
    }
    draw(moment, field, gain, hidden, camera) {
      const { gl, data, canvas } = this, last = data.frames - 1;
      const first = Math.min(Math.floor(moment), Math.max(last - 1, 0)), second = Math.min(first + 1, last);
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(1, 1, 1, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.useProgram(this.program);
      const frame = 6 * data.n;
      for (const [name, k] of [["from", first], ["to", second], ["rest", 0]])
        this.attribute(name, this.positions, 3, gl.UNSIGNED_SHORT, true, k * frame);
      this.attribute("part", this.parts, 1, gl.UNSIGNED_BYTE, false, 0);
      const chosen = field < 0 ? null : data.fields[field];
      for (const [name, k] of [["valueFrom", first], ["valueTo", second]]) {
        const place = gl.getAttribLocation(this.program, name);
        if (chosen) this.attribute(name, this.fields[field], 1, gl.UNSIGNED_SHORT, false, 2 * data.n * k);
        else if (place >= 0) { gl.disableVertexAttribArray(place); gl.vertexAttrib1f(place, NONE); }
      }
      const tall = 1 / (this.reach * camera.zoom), wide = (tall * canvas.height) / canvas.width;
      gl.uniform3fv(this.at("low"), this.low);
      gl.uniform3fv(this.at("size"), this.size);
      gl.uniform3fv(this.at("middle"), this.middle.map((m, i) => m + camera.shift[i]));
      gl.uniform1f(this.at("share"), moment - first);
      gl.uniform1f(this.at("gain"), gain);
      gl.uniformMatrix3fv(this.at("turn"), true, camera.axes().flat());
      gl.uniform3f(this.at("window"), wide, tall, 1 / (4 * this.reach * Math.max(gain, 1)));
      gl.uniform1i(this.at("hidden"), hidden);
      gl.uniform1i(this.at("coloured"), chosen ? 1 : 0);
      gl.uniform1i(this.at("ramp"), 0);
      gl.uniform1i(this.at("palette"), 1);
      gl.activeTexture(gl.TEXTURE1);
      gl.bindTexture(gl.TEXTURE_2D, this.palette);
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, chosen ? this.ramps[field] : this.palette);
      if (chosen) {
        const [a, b] = chosen.range, share = (v) => (v - a) / (b - a);
        gl.uniform2f(this.at("limits"), share(chosen.limits[0]), share(chosen.limits[1]));
      } else gl.uniform2f(this.at("limits"), 0, 1);
      for (const [lines, buffer, kind, count] of [
        [0, this.triangles, gl.TRIANGLES, data.n_triangles * 3], [1, this.edges, gl.LINES, data.n_edges * 2],
      ]) {
        gl.uniform1i(this.at("lines"), lines);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
        if (count) gl.drawElements(kind, count, gl.UNSIGNED_INT, 0);
      }
      return canvas.clientHeight * 0.5 * tall; // pixels of a millimetre
    }
  }

  class Camera {
    // a turntable: z stays up, lengths keep their scale
    constructor() { this.home(); }
    home() { Object.assign(this, { azimuth: 0.46, height: 0.33, zoom: 1, shift: [0, 0, 0] }); }
    look(azimuth, height) { Object.assign(this, { azimuth, height }); }
    axes() {
      const [c, s, e, f] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.height), Math.sin(this.height)];
      return [[c, s, 0], [-s * f, c * f, e], [s * e, -c * e, f]]; // right, up, toward the viewer
    }
    turn(dx, dy) {
      this.azimuth -= dx;
      this.height = Math.min(Math.max(this.height + dy, -Math.PI / 2), Math.PI / 2);
    }
    move(dx, dy) {
      const [right, up] = this.axes();
      this.shift = this.shift.map((value, i) => value - dx * right[i] + dy * up[i]);
    }
    closer(factor) { this.zoom = Math.min(Math.max(this.zoom / factor, 0.05), 5); }
  }

  function build(figure) {
    const data = JSON.parse(figure.querySelector("script").textContent);
    const fallback = figure.querySelector(".fallback");
    const canvas = make("canvas", { tabIndex: 0 });
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-label", `${data.title}. Turn with the arrow keys, zoom with plus and minus, Home resets, space plays.`);
    let scene;
    try {
      scene = new Scene(canvas, data);
    } catch (error) {
      fallback.textContent = `This browser cannot show the interactive view (${error.message}); the pictures of this page show the same.`;
      return;
    }
    const camera = new Camera(), last = data.frames - 1, timed = data.times !== null;
    let moment = data.shown, field = data.fields.length ? 0 : -1, gain = 1, hidden = 0, playing = false, before = 0, due = false;
    let scale = 1;

    const stage = make("div", { className: "stage" });
    const bar = make("div", { className: "bar" });
    const ruler = make("div", { className: "ruler" });
    const cross = svg("svg", { class: "cross", viewBox: "-30 -30 60 60", "aria-hidden": "true" });
    const arms = ["x", "y", "z"].map((name, i) => {
      const line = svg("line", { x1: 0, y1: 0, stroke: ["#b3261e", "#1b7a3d", "#1d4f91"][i], "stroke-width": 2 });
      const word = svg("text", { "font-size": 11, "text-anchor": "middle", "dominant-baseline": "middle" });
      word.textContent = name;
      cross.append(line, word);
      return [line, word];
    });
    // what is printed instead of the canvas
    const still = make("img", { className: "still", alt: data.title });
    stage.append(canvas, still, cross, ruler);
    const told = make("output", { className: "told" });

    const slider = make("input", { type: "range", min: 0, max: last, step: timed ? 0.25 : 0.05, value: moment });
    slider.setAttribute("aria-label", timed ? "time [s]" : "state");
    const play = make("button", { type: "button", textContent: "Play" });
    const pace = make("select", {}, ...[["1/10", 0.1], ["1/4", 0.25], ["1/2", 0.5], ["1", 1]].map(([text, value]) =>
      make("option", { value, textContent: `${text} of life's speed`, selected: value === 0.25 })));
    pace.setAttribute("aria-label", "speed");
    const colour = make("select", {}, ...data.fields.map((f, i) => make("option", { value: i, textContent: f.label })),
      make("option", { value: -1, textContent: "parts" }));
    const swell = make("input", { type: "range", min: 1, max: 5, step: 0.25, value: 1 });
    const swollen = make("output", { textContent: "×1" });
    const first = make("div", { className: "controls" });
    if (last > 0) first.append(play, make("label", {}, timed ? "time " : "state ", slider), told);
    if (last > 0 && timed) first.append(pace);
    const second = make("div", { className: "controls" }, make("label", { className: "tool" }, "colour ", colour));
    const swelling = make("label", { className: "tool" }, "deformation ", swell, swollen);
    if (data.gain) second.append(swelling);
    data.parts.forEach((part, i) => {
      const tick = make("input", { type: "checkbox", checked: true });
      const swatch = make("span", { className: "swatch" }), label = make("label", {}, tick, swatch, part.name);
      tick.onchange = () => { hidden ^= 1 << i; label.className = tick.checked ? "" : "tool"; redraw(); };
      swatch.style.background = `rgb(${part.colour})`;
      second.append(label);
    });
    const views = [["the front", 0, 0], ["the side", Math.PI / 2, 0], ["above", 0, Math.PI / 2], ["below", 0.46, -0.5]];
    const third = make("div", { className: "controls tool" }, "look from ");
    for (const [name, azimuth, height] of views)
      third.append(make("button", { type: "button", textContent: name, onclick: () => { camera.look(azimuth, height); redraw(); } }));
    third.append(make("button", { type: "button", textContent: "reset", onclick: home }));
    const hint = make("p", { className: "hint", textContent:
      "Drag to turn, with shift or two fingers to move; pinch, plus and minus or (after a click) the wheel zoom." });
    fallback.replaceWith(stage, bar, first, second, third, hint);

    function showBar() {
      bar.replaceChildren();
      if (field < 0) return;
      const f = data.fields[field], ramp = bytes(f.ramp), stops = [];
      for (let i = 0; i < 256; i += 15) stops.push(`rgb(${ramp[3 * i]},${ramp[3 * i + 1]},${ramp[3 * i + 2]})`);
      const strip = make("div", { className: "ramp" }), ticks = make("div", { className: "ticks" });
      strip.style.background = `linear-gradient(to right,${stops})`;
      const [low, high] = f.limits, rough = (high - low) / 5, ten = 10 ** Math.floor(Math.log10(rough));
      const step = [1, 2, 2.5, 5, 10].map((k) => k * ten).find((k) => k >= rough);
      for (let k = Math.ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; k++) {
        const tick = make("span", { textContent: number(k * step) });
        tick.style.left = `${(100 * (k * step - low)) / (high - low)}%`;
        ticks.append(tick);
      }
      bar.append(make("div", { className: "name", textContent: f.label }), strip, ticks);
      if (f.note) bar.append(make("div", { className: "note", textContent: f.note }));
    }
    function words() {
      if (timed) {
        const k = Math.min(Math.floor(moment), Math.max(last - 1, 0)), next = Math.min(k + 1, last);
        return `${(data.times[k] + (moment - k) * (data.times[next] - data.times[k])).toFixed(3)} s`;
      }
      const near = Math.round(moment);
      if (Math.abs(moment - near) < 0.01) return data.labels[near];
      return `between ${data.labels[Math.floor(moment)]} and ${data.labels[Math.ceil(moment)]}`;
    }
    function step(now) {
      due = false;
      if (playing) {
        const passed = Math.min((now - before) / 1000, 0.1);
        before = now;
        const span = timed ? (data.times[last] - data.times[0]) / last : 1 / 1.2;
        moment = (moment + (passed * (timed ? Number(pace.value) : 1)) / span) % last;
        slider.value = moment;
      }
      draw();
      if (playing) later();
    }
    function later() {
      if (!due) { due = true; requestAnimationFrame(step); }
    }
    function draw(ratio = Math.min(window.devicePixelRatio || 1, 2)) {
      const [wide, tall] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
      if (!wide || !tall) return;
      if (canvas.width !== wide || canvas.height !== tall) Object.assign(canvas, { width: wide, height: tall });
      scale = scene.draw(moment, field, gain, hidden, camera);
      told.textContent = words();
      slider.setAttribute("aria-valuetext", told.textContent);
      const length = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50].find((mm) => mm * scale > 60) || 100;
      // of the stage, so that it is right at any size the picture is printed in
      ruler.style.width = `${(100 * length * scale) / canvas.clientWidth}%`;
      ruler.textContent = `${length} mm`;
      const [right, up] = camera.axes();
      arms.forEach(([line, word], i) => {
        line.setAttribute("x2", 17 * right[i]); line.setAttribute("y2", -17 * up[i]);
        word.setAttribute("x", 24 * right[i]); word.setAttribute("y", -24 * up[i]);
      });
      figure.dataset.drawn = String(Number(figure.dataset.drawn || 0) + 1);
    }
    const redraw = () => later();
    function home() {
      camera.home();
      camera.zoom = scene.fit(camera);
      redraw();
    }
    function toggle() {
      playing = !playing && last > 0;
      play.textContent = playing ? "Pause" : "Play";
      before = performance.now();
      redraw();
    }

    slider.oninput = () => { moment = Number(slider.value); if (playing) toggle(); redraw(); };
    play.onclick = toggle;
    colour.onchange = () => { field = Number(colour.value); showBar(); redraw(); };
    swell.oninput = () => { gain = Number(swell.value); swollen.textContent = `×${gain}`; swelling.className = gain > 1 ? "" : "tool"; redraw(); };

    const fingers = new Map();
    canvas.onpointerdown = (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    };
    canvas.onpointerup = canvas.onpointercancel = (event) => fingers.delete(event.pointerId);
    canvas.onpointermove = (event) => {
      const own = fingers.get(event.pointerId);
      if (!own) return;
      const [dx, dy] = [event.clientX - own[0], event.clientY - own[1]];
      if (fingers.size > 1) {
        const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
        const apart = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]) || 1;
        camera.closer(apart([event.clientX, event.clientY]) / apart(own));
        camera.move(dx / 2 / scale, dy / 2 / scale);
      } else if (event.shiftKey || event.buttons === 4) camera.move(dx / scale, dy / scale);
      else camera.turn(0.008 * dx, 0.008 * dy);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      redraw();
    };
    canvas.addEventListener("wheel", (event) => {
      // a page that scrolls past keeps scrolling: the view zooms once it was clicked
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      camera.closer(Math.exp(-0.0015 * event.deltaY));
      redraw();
    }, { passive: false });
    canvas.onkeydown = (event) => {
      const keys = {
        ArrowLeft: () => camera.turn(-0.1, 0), ArrowRight: () => camera.turn(0.1, 0), ArrowUp: () => camera.turn(0, -0.1),
        ArrowDown: () => camera.turn(0, 0.1), "+": () => camera.closer(1.15), "=": () => camera.closer(1.15),
        "-": () => camera.closer(1 / 1.15), Home: home, " ": toggle,
      };
      if (!keys[event.key] || event.altKey || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      keys[event.key]();
      redraw();
    };
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      told.textContent = "the graphics card gave up this view; reload the page";
    });
    new ResizeObserver(redraw).observe(canvas);
    window.addEventListener("beforeprint", () => {
      draw(2); // as fine as paper
      still.src = canvas.toDataURL("image/png");
      stage.classList.add("stilled");
      draw();
    });
    window.addEventListener("afterprint", () => stage.classList.remove("stilled"));
    showBar();
    camera.zoom = scene.fit(camera);
    redraw();
  }

  document.querySelectorAll("figure.view3d").forEach(build);
})();
