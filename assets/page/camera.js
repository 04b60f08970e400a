// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a camera that looks at a point from a direction and a distance; x forward, y left, z up, radians, metres
const kFocal = 1.2; // of the view's height
const kNear = 0.1;
const kOverviewPitch = 0.5;
const kOutside = 0.01; // share of points that may lie outside an overview, on each side
const kFilled = 0.94;   // of the view, by the others

const add = (a, b, t) => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

class Camera {
    constructor(target, yaw, pitch, distance) {
        Object.assign(this, { target, yaw, pitch, distance }); // pitch: down is above 0
    }

    copy() {
        return new Camera([...this.target], this.yaw, this.pitch, this.distance);
    }

    axes() {
        const cp = Math.cos(this.pitch), sp = Math.sin(this.pitch), cy = Math.cos(this.yaw), sy = Math.sin(this.yaw);
        const forward = [cp * cy, cp * sy, -sp], right = [sy, -cy, 0];
        return { right, up: cross(right, forward), forward };
    }

    eye() {
        return add(this.target, this.axes().forward, -this.distance);
    }

    orbit(right, down) {
        this.yaw -= right;
        this.pitch = clamp(this.pitch + down, -1.5, 1.55);
    }

    // by pixels of a view of this height: what is at the target stays under the pointer
    pan(right, down, height) {
        const { right: x, up } = this.axes(), scale = this.distance / (kFocal * height);
        this.target = add(add(this.target, x, -right * scale), up, down * scale);
    }

    zoom(factor, low, high) {
        this.distance = clamp(this.distance * factor, low, high);
    }

    static between(a, b, t) {
        const mix = (x, y) => x + (y - x) * t;
        const turn = Math.atan2(Math.sin(b.yaw - a.yaw), Math.cos(b.yaw - a.yaw));
        return new Camera(a.target.map((x, i) => mix(x, b.target[i])), a.yaw + turn * t, mix(a.pitch, b.pitch),
            a.distance * Math.pow(b.distance / a.distance, t));
    }

    // sees nearly all of `points` (metres, an array of [x, y, z]) from above, looking along `yaw`
    static overview(points, yaw, aspect) {
        const middle = [0, 1, 2].map((axis) => share(points.map((p) => p[axis]), 0.5));
        const camera = new Camera(middle, yaw, kOverviewPitch, 1);
        const { right, up, forward } = camera.axes();
        const far = Math.max(...points.map((p) => Math.hypot(...minus(p, middle))), 1);
        camera.distance = 3 * far;
        // perspective moves what is near the most: half steps settle
        for (let round = 0; round < 24; ++round) {
            const eye = camera.eye(), seen = points.map((p) => minus(p, eye)).filter((p) => dot(forward, p) > kNear);
            const spans = [right, up].map((axis) => {
                const at = seen.map((p) => dot(axis, p) / dot(forward, p));
                return [share(at, kOutside), share(at, 1 - kOutside)];
            });
            const [x, y] = spans.map(([low, high]) => (low + high) / 4 * camera.distance);
            camera.target = add(add(camera.target, right, x), up, y);
            const size = Math.max((spans[0][1] - spans[0][0]) / aspect, spans[1][1] - spans[1][0]) * kFocal;
            camera.distance = clamp(camera.distance * Math.sqrt(size / kFilled), 0.5, 10 * far);
        }
        return camera;
    }
}

// the value below which this share of the values lies
function share(values, part) {
    const sorted = Float64Array.from(values).sort();
    return sorted[Math.round(part * (sorted.length - 1))];
}
