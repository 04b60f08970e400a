// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// points as round sprites with depth, then shading by how far neighbours lie behind (eye-dome lighting, Boucheny 2009)
const kPointVertex = `#version 300 es
layout(location = 0) in vec4 place; // 0..1 in the box; label / 65535
layout(location = 1) in vec4 color;
uniform vec3 offset, extent, right, up, forward, palette[32];
uniform vec2 scale, range;          // of x and y; near and far
uniform float diameter, largest;    // pixels at 1 m; pixels
uniform bool labelled;
uniform uint shown;
out vec3 shade;
out float depth;
out vec2 lens;                      // of depths to the buffer's
void main() {
    vec3 p = offset + place.xyz * extent;
    depth = dot(forward, p);
    uint label = uint(place.w * 65535.0 + 0.5);
    shade = labelled ? palette[label & 31u] : color.rgb;
    gl_PointSize = clamp(diameter / max(depth, 1e-3), 1.0, largest);
    lens = vec2(range.y + range.x, -2.0 * range.x * range.y) / (range.y - range.x);
    gl_Position = vec4(scale.x * dot(right, p), scale.y * dot(up, p), lens.x * depth + lens.y, depth);
    if ((shown >> label & 1u) == 0u)
        gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
}`;
const kPointFragment = `#version 300 es
precision highp float;
in vec3 shade;
in float depth;
in vec2 lens;
uniform float radius; // metres
out vec4 color;
void main() {
    vec2 d = 2.0 * gl_PointCoord - 1.0;
    float off = dot(d, d);
    if (off > 1.0)
        discard;
    color = vec4(shade, 1.0);
    gl_FragDepth = 0.5 + 0.5 * (lens.x + lens.y / (depth + radius * off)); // of neighbours the nearest middle wins
}`;
const kShadeVertex = `#version 300 es
void main() {
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;
const kShadeFragment = `#version 300 es
precision highp float;
uniform highp sampler2D depths, colors;
uniform vec2 range;
uniform float strength;
uniform int reach;
out vec4 color;
float logDepth(ivec2 at) {
    float z = 2.0 * texelFetch(depths, clamp(at, ivec2(0), textureSize(depths, 0) - 1), 0).r - 1.0;
    return log2(2.0 * range.x * range.y / (range.y + range.x - z * (range.y - range.x)));
}
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 c = texelFetch(colors, at, 0);
    if (c.a == 0.0) {
        color = vec4(0.0);
        return;
    }
    float own = logDepth(at), sum = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 d = reach * (i < 2 ? ivec2(2 * i - 1, 0) : ivec2(0, 2 * i - 5));
        sum += max(0.0, own - logDepth(at + d));
    }
    color = vec4(c.rgb * exp(-strength * sum), 1.0);
}`;

function compile(gl, vertex, fragment) {
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, text);
        gl.compileShader(shader);
        if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
            throw new Error("a shader of the point view: " + gl.getShaderInfoLog(shader));
        gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    // a uniform's place by its name
    return new Proxy({}, { get: (_, name) => name === "program" ? program : gl.getUniformLocation(program, name) });
}

class WebglDrawer {
    // none where the browser has no WebGL 2
    static create(canvas, palette) {
        const gl = canvas.getContext("webgl2", { antialias: false, depth: false, powerPreference: "high-performance" });
        return gl && new WebglDrawer(gl, palette);
    }

    constructor(gl, palette) {
        this.name = "webgl2";
        this.finest = (window.devicePixelRatio || 1) < 1.5 ? 2 : 1; // samples a pixel of the screen, each way
        this.gl = gl;
        this.palette = new Float32Array(96);
        palette.forEach(({ color }, i) => this.palette.set(color.map((c) => c / 255), 3 * i));
        this.largest = gl.getParameter(gl.ALIASED_POINT_SIZE_RANGE)[1];
        this.scenes = new Map();
        this.start();
        gl.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
        gl.canvas.addEventListener("webglcontextrestored", () => {
            this.scenes.clear();
            this.start();
            this.restored && this.restored();
        });
    }

    start() {
        const gl = this.gl;
        this.points = compile(gl, kPointVertex, kPointFragment);
        this.shade = compile(gl, kShadeVertex, kShadeFragment);
        this.empty = gl.createVertexArray();
        this.frame = gl.createFramebuffer();
        this.size = "";
    }

    upload(scene) {
        if (this.scenes.has(scene))
            return this.scenes.get(scene);
        const gl = this.gl, n = scene.count, buffer = new ArrayBuffer(12 * n);
        const words = new Uint16Array(buffer), bytes = new Uint8Array(buffer);
        for (let i = 0; i < n; ++i) {
            for (let k = 0; k < 3; ++k) {
                words[6 * i + k] = scene.quantised[3 * i + k];
                bytes[12 * i + 8 + k] = scene.colors[3 * i + k];
            }
            words[6 * i + 3] = scene.labels[i];
        }
        const array = gl.createVertexArray();
        gl.bindVertexArray(array);
        gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ARRAY_BUFFER, buffer, gl.STATIC_DRAW);
        gl.enableVertexAttribArray(0);
        gl.vertexAttribPointer(0, 4, gl.UNSIGNED_SHORT, true, 12, 0);
        gl.enableVertexAttribArray(1);
        gl.vertexAttribPointer(1, 4, gl.UNSIGNED_BYTE, true, 12, 8);
        this.scenes.set(scene, array);
        return array;
    }

    // textures to draw into, as large as the canvas
    fit(width, height) {
        const gl = this.gl, size = `${width} ${height}`;
        if (this.size === size)
            return;
        this.size = size;
        [this.colors, this.depths].forEach((texture) => texture && gl.deleteTexture(texture));
        const texture = (internal, format, type) => {
            const t = gl.createTexture();
            gl.bindTexture(gl.TEXTURE_2D, t);
            gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, format, type, null);
            gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
            gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
            return t;
        };
        this.colors = texture(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE);
        this.depths = texture(gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT);
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.colors, 0);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.depths, 0);
    }

    draw(scene, camera, look) {
        const gl = this.gl, { width, height } = gl.canvas;
        const { right, up, forward } = camera.axes(), eye = camera.eye();
        const range = [kNear, Math.max(look.reach + camera.distance, 1)], p = this.points;
        const array = this.upload(scene);
        this.fit(width, height);
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
        gl.viewport(0, 0, width, height);
        gl.enable(gl.DEPTH_TEST);
        gl.clearColor(0, 0, 0, 0);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.useProgram(p.program);
        gl.uniform3fv(p.offset, minus(scene.low, eye));
        gl.uniform3fv(p.extent, scene.step.map((s) => 65535 * s));
        gl.uniform3fv(p.right, right);
        gl.uniform3fv(p.up, up);
        gl.uniform3fv(p.forward, forward);
        gl.uniform3fv(p.palette, this.palette);
        gl.uniform2f(p.scale, 2 * kFocal * height / width, 2 * kFocal);
        gl.uniform2fv(p.range, range);
        gl.uniform1f(p.diameter, scene.diameter * kFocal * height);
        gl.uniform1f(p.radius, scene.diameter / 2);
        gl.uniform1f(p.largest, Math.min(this.largest, height / 4));
        gl.uniform1i(p.labelled, look.labelled ? 1 : 0);
        gl.uniform1ui(p.shown, look.shown);
        gl.bindVertexArray(array);
        gl.drawArrays(gl.POINTS, 0, scene.count);
        this.drawShaded(range, look);
        return scene.count;
    }

    drawShaded(range, look) {
        const gl = this.gl, s = this.shade;
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        gl.disable(gl.DEPTH_TEST);
        gl.useProgram(s.program);
        [this.colors, this.depths].forEach((texture, unit) => {
            gl.activeTexture(gl.TEXTURE0 + unit);
            gl.bindTexture(gl.TEXTURE_2D, texture);
        });
        gl.uniform1i(s.colors, 0);
        gl.uniform1i(s.depths, 1);
        gl.uniform2fv(s.range, range);
        gl.uniform1f(s.strength, look.strength);
        gl.uniform1i(s.reach, look.samples);
        gl.bindVertexArray(this.empty);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    // RGBA of what was just drawn, before the browser takes it
    pixels() {
        const gl = this.gl, out = new Uint8Array(4 * gl.canvas.width * gl.canvas.height);
        gl.readPixels(0, 0, gl.canvas.width, gl.canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, out);
        return out;
    }
}
