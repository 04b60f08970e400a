// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the same picture as draw_webgl.js, drawn by the processor where there is no WebGL 2
class CanvasDrawer {
    constructor(canvas, palette) {
        this.name = "canvas";
        this.finest = 1 / Math.max(window.devicePixelRatio || 1, 1); // a sample a CSS pixel
        this.canvas = canvas;
        this.context = canvas.getContext("2d");
        this.palette = Uint8Array.from(palette.flatMap(({ color }) => color));
    }

    fit(width, height) {
        if (this.image && this.image.width === width && this.image.height === height)
            return;
        this.image = this.context.createImageData(width, height);
        this.words = new Uint32Array(this.image.data.buffer);
        this.depth = new Float32Array(width * height);
        this.logs = new Float32Array(width * height);
    }

    draw(scene, camera, look) {
        const { width, height } = this.canvas;
        this.fit(width, height);
        this.words.fill(0);
        this.depth.fill(Infinity);
        const drawn = this.drawPoints(scene, camera, look, width, height);
        this.shade(look, width, height);
        this.context.putImageData(this.image, 0, 0);
        return drawn;
    }

    drawPoints(scene, camera, look, width, height) {
        const { right: r, up: u, forward: f } = camera.axes(), o = minus(scene.low, camera.eye());
        const { positions, labels } = scene, source = look.labelled ? this.palette : scene.colors;
        const focal = kFocal * height, largest = height / 4;
        let drawn = 0;
        for (let i = 0; i < scene.count; ++i) {
            const label = labels[i];
            if (!(look.shown >>> label & 1))
                continue;
            const x = o[0] + positions[3 * i], y = o[1] + positions[3 * i + 1], z = o[2] + positions[3 * i + 2];
            ++drawn;
            const depth = f[0] * x + f[1] * y + f[2] * z;
            if (depth < kNear)
                continue;
            const scale = focal / depth;
            const px = width / 2 + (r[0] * x + r[1] * y + r[2] * z) * scale;
            const py = height / 2 - (u[0] * x + u[1] * y + u[2] * z) * scale;
            const size = Math.min(Math.max(scene.diameter * scale, 1), largest);
            if (px + size < 0 || py + size < 0 || px - size > width || py - size > height)
                continue;
            const c = 3 * (look.labelled ? label : i);
            const color = (255 << 24 | source[c + 2] << 16 | source[c + 1] << 8 | source[c]) >>> 0;
            this.disc(px, py, size / 2, depth, scene.diameter / 2, color, width, height);
        }
        return drawn;
    }

    // of neighbours the nearest middle wins: a disc is `bulge` metres deeper at its edge
    disc(px, py, radius, depth, bulge, color, width, height) {
        const top = Math.max(Math.ceil(py - radius - 0.5), 0);
        const bottom = Math.min(Math.floor(py + radius - 0.5), height - 1), fall = bulge / (radius * radius);
        for (let y = top; y <= bottom; ++y) {
            const dy = y + 0.5 - py, half = Math.sqrt(Math.max(radius * radius - dy * dy, 0.25));
            const left = Math.max(Math.ceil(px - half - 0.5), 0);
            const right = Math.min(Math.floor(px + half - 0.5), width - 1);
            for (let x = left; x <= right; ++x) {
                const dx = x + 0.5 - px, here = depth + fall * (dx * dx + dy * dy), at = y * width + x;
                if (here < this.depth[at]) {
                    this.depth[at] = here;
                    this.words[at] = color;
                }
            }
        }
    }

    shade(look, width, height) {
        const { depth, logs, image: { data } } = this, n = width * height, reach = look.samples;
        for (let i = 0; i < n; ++i)
            logs[i] = Math.log2(depth[i]);
        for (let y = 0, i = 0; y < height; ++y)
            for (let x = 0; x < width; ++x, ++i) {
                if (depth[i] === Infinity)
                    continue;
                const own = logs[i];
                const sum = Math.max(0, own - logs[x < reach ? i : i - reach]) +
                    Math.max(0, own - logs[x + reach < width ? i + reach : i]) +
                    Math.max(0, own - logs[y < reach ? i : i - reach * width]) +
                    Math.max(0, own - logs[y + reach < height ? i + reach * width : i]);
                const light = Math.exp(-look.strength * sum);
                data[4 * i] *= light;
                data[4 * i + 1] *= light;
                data[4 * i + 2] *= light;
            }
    }

    pixels() {
        return this.context.getImageData(0, 0, this.canvas.width, this.canvas.height).data;
    }
}
