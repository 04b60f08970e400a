// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the point view: what is drawn when, and how hands move the camera
const kSlowFrame = 60; // milliseconds: coarser pictures while moving
const kDriveSpeed = 7; // metres a second
const kOverviewPoints = 1500; // enough to find a view by

class Orbit {
    constructor(data) {
        this.data = data;
        this.scenes = data.scenes.map(readScene);
        this.scene = this.scenes[0];
        this.path = data.path;
        const { low, step } = this.scene;
        this.high = low.map((l, i) => l + 65535 * step[i]);
        this.radius = Math.hypot(...minus(this.high, low)) / 2 || 1;
        this.look = { labelled: this.scene.centers, shown: 0xffffffff, reach: 2 * this.radius };
        this.coarse = 1;
        this.chooseDrawer();
        this.camera = this.overview();
        this.controls();
        this.legend();
        this.listen();
        new ResizeObserver(() => this.redraw()).observe(this.canvas);
        this.draw();
    }

    chooseDrawer() {
        this.canvas = $("view");
        let drawer = null;
        try {
            drawer = asked.has("canvas") ? null : WebglDrawer.create(this.canvas, this.data.palette);
        } catch (problem) {
            console.warn(problem);
            const fresh = this.canvas.cloneNode(); // one with a context of WebGL gives no other
            this.canvas.replaceWith(fresh);
            this.canvas = fresh;
        }
        this.drawer = drawer || new CanvasDrawer(this.canvas, this.data.palette);
        this.drawer.restored = () => this.draw();
        report.renderer = this.drawer.name;
    }

    // along the path, or else along the longer side; a little from the side
    overview() {
        const box = this.canvas.getBoundingClientRect(), { positions, count } = this.scene, points = [];
        for (let i = 0; i < kOverviewPoints; ++i) {
            const at = 3 * Math.floor(i * count / kOverviewPoints);
            points.push(add(this.scene.low, positions.subarray(at, at + 3), 1));
        }
        const size = minus(this.high, this.scene.low), last = this.path.length - 1;
        const along = last > 0 ? minus(this.path[last], this.path[0]) : size[0] >= size[1] ? [1, 0] : [0, 1];
        return Camera.overview(points, Math.atan2(along[1], along[0]) + 0.32, (box.width || 16) / (box.height || 9));
    }

    // ---- drawing

    redraw() {
        if (!this.asked)
            this.asked = requestAnimationFrame(() => this.draw());
    }

    // coarser while in motion where drawing is slow, fine again afterwards
    moved() {
        this.moving = true;
        clearTimeout(this.still);
        this.still = setTimeout(() => {
            this.moving = false;
            this.redraw();
        }, 180);
        this.redraw();
    }

    draw() {
        cancelAnimationFrame(this.asked);
        this.asked = 0;
        const begin = performance.now(), box = this.canvas.getBoundingClientRect();
        const ratio = (window.devicePixelRatio || 1) * this.drawer.finest * (this.moving ? this.coarse : 1);
        const [width, height] = [box.width, box.height].map((side) => clamp(Math.round(side * ratio), 1, 4096));
        if (this.canvas.width !== width || this.canvas.height !== height)
            Object.assign(this.canvas, { width, height });
        this.look.strength = this.look.labelled ? 2.2 : 0.9; // flat colours need more to look solid
        this.look.samples = Math.max(Math.round((this.look.labelled ? 2 : 1.4) * height / (box.height || height)), 1);
        report.points = this.drawer.draw(this.scene, this.camera, this.look);
        if (this.moving && this.drawer.name === "canvas")
            this.coarse = clamp(this.coarse * (performance.now() - begin > kSlowFrame ? 0.7 : 1.1), 0.4, 1);
        publish();
    }

    flyTo(camera) {
        const from = this.camera.copy(), begin = performance.now(), time = quietMotion ? 0 : 450;
        this.stop();
        this.goal = camera;
        const step = () => {
            const t = time ? clamp((performance.now() - begin) / time, 0, 1) : 1;
            this.camera = Camera.between(from, camera, t * t * (3 - 2 * t));
            this.moved();
            this.flight = t < 1 ? requestAnimationFrame(step) : 0;
        };
        step();
    }

    stop() {
        cancelAnimationFrame(this.flight);
        this.flight = 0;
        if (this.driving)
            this.setDriving(false);
    }

    // ---- along the path

    onPath(at) {
        const last = this.path.length - 1, i = clamp(Math.floor(at), 0, Math.max(last - 1, 0)), ahead = 6;
        const poses = [this.path[i], this.path[Math.min(i + 1, last)]].map(([x, y, z, fx, fy, fz]) =>
            new Camera(add([x, y, z], [fx, fy, fz], ahead), Math.atan2(fy, fx), Math.asin(clamp(-fz, -1, 1)), ahead));
        return Camera.between(...poses, clamp(at - i, 0, 1));
    }

    setDriving(driving) {
        this.driving = driving;
        this.driveButton.setAttribute("aria-pressed", driving);
        this.driveButton.textContent = driving ? "Stop" : "Drive";
    }

    drive() {
        this.stop();
        let length = 0;
        for (let i = 1; i < this.path.length; ++i)
            length += Math.hypot(...minus(this.path[i].slice(0, 3), this.path[i - 1].slice(0, 3)));
        const time = clamp(length / kDriveSpeed, 3, 90) * 1000, begin = performance.now();
        this.setDriving(true);
        const step = () => {
            const t = clamp((performance.now() - begin) / time, 0, 1);
            this.camera = this.onPath(t * (this.path.length - 1));
            this.moved();
            if (t < 1)
                this.flight = requestAnimationFrame(step);
            else
                this.stop();
        };
        step();
    }

    // ---- hands

    listen() {
        const { canvas } = this, held = new Map();
        let pan = false;
        const spread = () => {
            const [a, b] = [...held.values()];
            return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.hypot(a.x - b.x, a.y - b.y) || 1 };
        };
        canvas.addEventListener("contextmenu", (event) => event.preventDefault());
        canvas.addEventListener("pointerdown", (event) => {
            this.stop();
            capture(canvas, event);
            canvas.focus({ preventScroll: true });
            canvas.classList.add("held");
            pan = event.button > 0 || event.shiftKey;
            held.set(event.pointerId, { x: event.clientX, y: event.clientY });
        });
        canvas.addEventListener("pointermove", (event) => {
            const from = held.get(event.pointerId), height = canvas.clientHeight;
            if (!from)
                return;
            const before = held.size === 2 && spread();
            held.set(event.pointerId, { x: event.clientX, y: event.clientY });
            if (before) {
                const now = spread();
                this.camera.pan(now.x - before.x, now.y - before.y, height);
                this.zoom(before.apart / now.apart);
            } else if (pan) {
                this.camera.pan(event.clientX - from.x, event.clientY - from.y, height);
            } else {
                this.camera.orbit((event.clientX - from.x) * 0.006, (event.clientY - from.y) * 0.006);
            }
            this.moved();
        });
        for (const end of ["pointerup", "pointercancel"])
            canvas.addEventListener(end, (event) => {
                held.delete(event.pointerId);
                if (!held.size)
                    canvas.classList.remove("held");
            });
        // a page that is scrolled past the view is not caught by it: first a click
        canvas.addEventListener("wheel", (event) => {
            if (document.activeElement !== canvas && !event.ctrlKey)
                return;
            event.preventDefault();
            this.stop();
            this.zoom(Math.exp(clamp(event.deltaY * (event.deltaMode ? 0.05 : 0.0015), -0.5, 0.5)));
        }, { passive: false });
        canvas.addEventListener("dblclick", (event) => this.centre(event));
        canvas.addEventListener("keydown", (event) => this.onKey(event));
    }

    zoom(factor) {
        this.camera.zoom(factor, 0.3, 12 * this.radius);
        this.moved();
    }

    onKey(event) {
        const step = event.shiftKey ? 40 : 0, height = this.canvas.clientHeight;
        const turn = (right, down) => step ? this.camera.pan(-step * right, -step * down, height)
            : this.camera.orbit(0.08 * right, 0.08 * down);
        const act = {
            ArrowLeft: () => turn(-1, 0),
            ArrowRight: () => turn(1, 0),
            ArrowUp: () => turn(0, -1),
            ArrowDown: () => turn(0, 1),
            "+": () => this.zoom(0.9),
            "=": () => this.zoom(0.9),
            "-": () => this.zoom(1 / 0.9),
            0: () => this.flyTo(this.overview()),
        }[event.key];
        if (!act || event.ctrlKey || event.metaKey || event.altKey)
            return;
        event.preventDefault();
        event.stopPropagation();
        this.stop();
        act();
        this.moved();
    }

    // the nearest point within a few pixels becomes what the camera looks at
    centre(event) {
        const box = this.canvas.getBoundingClientRect(), { right, up, forward } = this.camera.axes();
        const { low, positions, labels, count } = this.scene, offset = minus(low, this.camera.eye());
        const x = event.clientX - box.left - box.width / 2, y = box.top + box.height / 2 - event.clientY;
        const focal = kFocal * box.height;
        let best = Infinity, hit = null;
        for (let i = 0; i < count; ++i) {
            if (!(this.look.shown >>> labels[i] & 1))
                continue;
            const p = add(offset, positions.subarray(3 * i, 3 * i + 3), 1), depth = dot(forward, p);
            if (depth < kNear || depth >= best)
                continue;
            const off = Math.hypot(dot(right, p) * focal / depth - x, dot(up, p) * focal / depth - y);
            if (off <= Math.max(this.scene.diameter * focal / depth / 2, 4)) {
                best = depth;
                hit = [...positions.subarray(3 * i, 3 * i + 3)];
            }
        }
        if (!hit)
            return;
        const to = this.camera.copy();
        to.target = add(low, hit, 1);
        to.distance = Math.max(Math.min(to.distance, best) * 0.6, 2);
        this.flyTo(to);
    }

    // ---- what can be chosen

    segment(label, choices, chosen, choose) {
        const group = element("div", { className: "segment" });
        group.setAttribute("role", "group");
        group.setAttribute("aria-label", label);
        choices.forEach((text, i) => {
            const button = element("button", { type: "button", textContent: text });
            button.setAttribute("aria-pressed", i === chosen);
            button.onclick = () => {
                [...group.children].forEach((other, k) => other.setAttribute("aria-pressed", i === k));
                choose(i);
                this.redraw();
            };
            group.append(button);
        });
        $("controls").append(group);
    }

    controls() {
        if (this.scenes.length > 1)
            this.segment("Scene", this.scenes.map((scene) => scene.name), 0, (i) => {
                this.scene = this.scenes[i];
                this.legend();
            });
        if (this.scenes.some((scene) => !scene.centers))
            this.segment("Colours", ["Colour", "Label"], this.look.labelled ? 1 : 0, (i) => {
                this.look.labelled = i === 1;
            });
        $("controls").append(element("span", { className: "gap" }));
        this.driveButton = element("button", { type: "button", className: "plain", textContent: "Drive" });
        this.driveButton.setAttribute("aria-pressed", false);
        this.driveButton.onclick = () => this.driving ? this.stop() : this.drive();
        if (this.path.length > 1)
            $("controls").append(this.driveButton);
        const reset = element("button", { type: "button", className: "plain", textContent: "Whole scene" });
        reset.onclick = () => this.flyTo(this.overview());
        $("controls").append(reset);
    }

    legend() {
        const counts = new Map();
        for (const label of this.scene.labels)
            counts.set(label, (counts.get(label) || 0) + 1);
        const buttons = [...counts].sort((a, b) => b[1] - a[1]).map(([label]) => {
            const { name, color } = this.data.palette[label];
            const swatch = element("span", { className: "swatch" });
            swatch.style.background = `rgb(${color})`;
            const button = element("button", { type: "button" }, swatch, name);
            button.setAttribute("aria-pressed", (this.look.shown >>> label & 1) === 1);
            button.onclick = () => {
                this.look.shown = (this.look.shown ^ 1 << label) >>> 0;
                button.setAttribute("aria-pressed", (this.look.shown >>> label & 1) === 1);
                this.redraw();
            };
            return button;
        });
        $("legend").replaceChildren(...buttons);
    }
}
