// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the page tries itself when its address ends in #check, and adds what it found to the report
function differing(a, b) {
    let count = 0;
    for (let i = 0; i < a.length; i += 4)
        if (a[i] !== b[i] || a[i + 1] !== b[i + 1] || a[i + 2] !== b[i + 2] || a[i + 3] !== b[i + 3])
            ++count;
    return count;
}

function visible(pixels) {
    let count = 0;
    for (let i = 3; i < pixels.length; i += 4)
        count += pixels[i] > 0;
    return count;
}

// mean colours of 8 x 6 parts, from the top left
function parts(pixels, width, bottomUp) {
    const sums = new Float64Array(4 * 48), height = pixels.length / 4 / width;
    for (let i = 0; i < pixels.length / 4; ++i) {
        const row = Math.floor(Math.floor(i / width) * 6 / height), column = Math.floor(i % width * 8 / width);
        const part = 4 * (8 * (bottomUp ? 5 - row : row) + column);
        for (let c = 0; c < 3; ++c)
            sums[part + c] += pixels[4 * i + c];
        ++sums[part + 3];
    }
    return [...sums].filter((_, i) => i % 4 < 3).map((sum, i) => Math.round(sum / sums[4 * Math.floor(i / 3) + 3]));
}

function point(node, kind, x, y, more = {}) {
    const box = node.getBoundingClientRect();
    const at = { clientX: box.left + x * box.width, clientY: box.top + y * box.height };
    const make = kind === "wheel" ? WheelEvent : kind === "dblclick" ? MouseEvent : PointerEvent;
    node.dispatchEvent(new make(kind, { pointerId: 7, bubbles: true, cancelable: true, ...at, ...more }));
}

function drag(node, from, to, more) {
    point(node, "pointerdown", ...from, more);
    point(node, "pointermove", ...to, more);
    point(node, "pointerup", ...to, more);
}

const wait = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));
const stagePixels = (id) => $(id).getContext("2d").getImageData(0, 0, $(id).width, $(id).height).data;

async function checkPlayer(player) {
    const moments = player.moments.length;
    for (let moment = 0; moment < moments; ++moment)
        await player.show(moment);
    await player.show(0);
    const found = { pictures: moments * player.sets.length, moments, visible: visible(stagePixels("stage-left")) };
    const first = stagePixels("stage-right");
    found.sets_differ = differing(first, stagePixels("stage-left"));
    document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
    await player.show(player.wanted);
    found.moment_after_key = player.moment;
    found.moments_differ = differing(first, stagePixels("stage-right"));
    drag($("stage"), [0.5, 0.5], [0.25, 0.5]);
    found.border_after_drag = player.border;
    $("divider").dispatchEvent(new KeyboardEvent("keydown", { key: "End", bubbles: true }));
    found.border_after_end = player.border;
    player.setBorder(0.5);
    $("play").click();
    await wait(1.5 * kMomentMilliseconds);
    found.playing = $("play").getAttribute("aria-pressed");
    found.moment_after_play = player.moment; // two further on
    $("play").click();
    await player.show(0);
    return found;
}

function pinch(node) {
    for (const [kind, reach] of [["pointerdown", 0.1], ["pointermove", 0.2], ["pointerup", 0.2]])
        for (const side of [-1, 1])
            point(node, kind, 0.5 + side * reach, 0.5, { pointerId: 8 + side });
}

function checkOrbit(orbit) {
    orbit.canvas.scrollIntoView({ block: "center" });
    const pixels = () => {
        orbit.moving = false;
        orbit.draw();
        return orbit.drawer.pixels();
    };
    // how many samples an action changes; everything is as before afterwards
    const changes = (act) => {
        const camera = orbit.camera.copy(), look = { ...orbit.look }, before = pixels();
        act();
        const count = differing(before, pixels());
        orbit.stop();
        Object.assign(orbit, { camera });
        Object.assign(orbit.look, look);
        return count;
    };
    const first = pixels(), { canvas } = orbit, target = [...orbit.camera.target], view = orbit.camera.copy();
    const found = { samples: first.length / 4, visible: visible(first) };
    const { low, positions, colors, labels, count } = orbit.scene;
    found.last_point = [...add(low, positions.slice(3 * count - 3), 1), ...colors.slice(-3), labels[count - 1]];
    found.parts = parts(first, canvas.width, orbit.drawer.name === "webgl2");
    found.still = changes(() => 0);
    found.orbit = changes(() => drag(canvas, [0.5, 0.5], [0.6, 0.45]));
    found.pan = changes(() => drag(canvas, [0.5, 0.5], [0.6, 0.5], { button: 2 }));
    found.pinch = changes(() => pinch(canvas));
    found.wheel = changes(() => point(canvas, "wheel", 0.5, 0.5, { deltaY: -240 }));
    found.key = changes(() => canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true })));
    found.labels = changes(() => orbit.look.labelled = !orbit.look.labelled);
    found.hidden = changes(() => orbit.look.shown = 0);
    found.drive = changes(() => orbit.path.length > 1 && (orbit.camera = orbit.onPath(0.5)));
    found.scenes = orbit.scenes.length;
    found.view = [view.target, view.yaw, view.pitch, view.distance].flat().map((x) => Number(x.toFixed(4)));
    found.target_kept = minus(target, orbit.camera.target).every((d) => d === 0);
    point(canvas, "dblclick", 0.5, 0.6);
    found.closer = orbit.goal ? view.distance / orbit.goal.distance : 0;
    orbit.stop();
    orbit.camera = view;
    pixels();
    return found;
}

async function check(player, orbit) {
    report.player = player ? await checkPlayer(player) : null;
    report.orbit = orbit ? checkOrbit(orbit) : null;
    report.layout = { width: window.innerWidth, content: document.documentElement.scrollWidth };
    report.finished = true;
    publish();
}
