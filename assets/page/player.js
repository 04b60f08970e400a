// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// sets of pictures of the same moments: two of them on each other with a border to drag, all of them in a row
const kMomentMilliseconds = 125;
const kKeptPictures = 96; // decoded ones

// pictures are decoded when they are wanted, and the ones wanted longest ago are forgotten
class Pictures {
    constructor() {
        this.kept = new Map();
        this.decoded = new Set();
    }

    get(set, moment) {
        const id = `picture-${set}-${moment}`;
        const picture = this.kept.get(id) || this.decode(id);
        this.kept.delete(id);
        this.kept.set(id, picture);
        if (this.kept.size > kKeptPictures)
            this.kept.delete(this.kept.keys().next().value);
        return picture;
    }

    decode(id) {
        const source = $(id);
        return new Promise((done, failed) => {
            const image = new Image();
            image.onload = () => {
                this.decoded.add(id);
                report.frames = this.decoded.size;
                publish();
                done(image);
            };
            image.onerror = () => failed(new Error(`${id} is not a picture`));
            image.src = `data:${source.dataset.type};base64,${source.textContent}`;
        });
    }
}

class Player {
    constructor(data) {
        this.sets = data.sets;
        this.moments = data.moments;
        this.pictures = new Pictures();
        this.moment = 0;
        this.wanted = 0;
        this.timer = 0;
        this.border = 0.5;
        this.buildStage();
        this.buildRow();
        this.buildTransport();
        this.choose(0, this.sets.length - 1);
        this.setBorder(0.5);
        this.show(0);
    }

    buildStage() {
        const stage = $("stage"), first = this.sets[0];
        stage.style.aspectRatio = `${first.width} / ${first.height}`;
        const widest = Math.max(2 * first.width, 880), highest = (76 * first.width / first.height).toFixed(2);
        stage.style.maxWidth = `min(${widest}px, ${highest}vh)`;
        document.querySelector(".transport").style.maxWidth = stage.style.maxWidth;
        stage.classList.toggle("single", this.sets.length < 2);
        $("divider").hidden = $("tag-left").hidden = this.sets.length < 2;
        if (this.sets.length < 2)
            return;
        const follow = (event) => {
            const box = stage.getBoundingClientRect();
            this.setBorder((event.clientX - box.left) / box.width);
        };
        stage.addEventListener("pointerdown", (event) => {
            if (event.button !== 0)
                return;
            capture(stage, event);
            this.dragging = true;
            follow(event);
        });
        stage.addEventListener("pointermove", (event) => this.dragging && follow(event));
        for (const end of ["pointerup", "pointercancel"])
            stage.addEventListener(end, () => this.dragging = false);
        $("divider").addEventListener("keydown", (event) => {
            const to = { ArrowLeft: this.border - 0.02, ArrowDown: this.border - 0.02, ArrowRight: this.border + 0.02,
                ArrowUp: this.border + 0.02, Home: 0, End: 1 }[event.key];
            if (to === undefined)
                return;
            event.preventDefault();
            event.stopPropagation();
            this.setBorder(to);
        });
    }

    buildRow() {
        const row = $("row");
        row.style.setProperty("--sets", this.sets.length);
        row.hidden = this.sets.length < 2;
        this.cells = this.sets.map((set, index) => {
            const canvas = element("canvas", { width: set.width, height: set.height });
            canvas.setAttribute("role", "img");
            canvas.setAttribute("aria-label", set.name);
            const [left, right] = ["left", "right"].map((side) => {
                const title = `On the ${side}`;
                const button = element("button", { type: "button", className: `half ${side}`, title });
                button.setAttribute("aria-label", `Show ${set.name} on the ${side}`);
                return button;
            });
            left.onclick = () => this.choose(index, this.right === index ? this.left : this.right);
            right.onclick = () => this.choose(this.left === index ? this.right : this.left, index);
            const name = element("span", { textContent: set.name, title: set.name });
            row.append(element("figure", {}, canvas, element("div", { className: "name" }, name, left, right)));
            return { canvas, left, right };
        });
    }

    buildTransport() {
        const scrub = $("scrub");
        scrub.max = this.moments.length - 1;
        scrub.addEventListener("input", () => {
            this.pause();
            this.show(Number(scrub.value));
        });
        $("play").addEventListener("click", () => this.timer ? this.pause() : this.play());
        document.querySelector(".transport").hidden = this.moments.length < 2;
        document.addEventListener("keydown", (event) => this.onKey(event));
    }

    onKey(event) {
        const own = event.target === document.body || $("player").contains(event.target);
        if (!own || event.target === $("scrub") || event.ctrlKey || event.metaKey || event.altKey)
            return;
        const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
        if (!step)
            return;
        event.preventDefault();
        this.pause();
        this.show(clamp(this.wanted + step, 0, this.moments.length - 1));
    }

    setBorder(share) {
        this.border = clamp(share, 0, 1);
        const percent = 100 * this.border;
        $("stage-left").style.clipPath = this.sets.length < 2 ? "none" : `inset(0 ${100 - percent}% 0 0)`;
        $("divider").style.left = `${percent}%`;
        $("divider").setAttribute("aria-valuenow", percent.toFixed(0));
    }

    choose(left, right) {
        this.left = left;
        this.right = right;
        for (const [side, index] of [["left", left], ["right", right]]) {
            const { name, width, height } = this.sets[index];
            $(`tag-${side}`).textContent = name;
            Object.assign($(`stage-${side}`), { width, height });
            $(`stage-${side}`).setAttribute("role", "img");
            $(`stage-${side}`).setAttribute("aria-label", name);
            this.cells.forEach((cell, i) => cell[side].setAttribute("aria-pressed", i === index));
        }
        this.show(this.wanted);
    }

    // all pictures of a moment appear at once; of moments asked for in a row the last one wins
    async show(moment) {
        this.wanted = moment;
        const images = await Promise.all(this.sets.map((_, set) => this.pictures.get(set, moment)));
        if (this.wanted !== moment)
            return;
        this.moment = moment;
        this.cells.forEach((cell, set) => cell.canvas.getContext("2d").drawImage(images[set], 0, 0));
        $("stage-left").getContext("2d").drawImage(images[this.left], 0, 0);
        $("stage-right").getContext("2d").drawImage(images[this.right], 0, 0);
        $("scrub").value = moment;
        const { length } = this.moments;
        $("scrub").setAttribute("aria-valuetext", `${moment + 1} of ${length}, picture ${this.moments[moment]}`);
        $("moment").textContent = `${moment + 1} / ${this.moments.length}`;
    }

    play() {
        const next = async () => {
            const begin = performance.now();
            await this.show((this.wanted + 1) % this.moments.length);
            if (this.timer)
                this.timer = setTimeout(next, Math.max(kMomentMilliseconds - (performance.now() - begin), 0));
        };
        this.timer = setTimeout(next, 0);
        this.setPlaying(true);
    }

    pause() {
        clearTimeout(this.timer);
        this.timer = 0;
        this.setPlaying(false);
    }

    setPlaying(playing) {
        $("play").setAttribute("aria-pressed", playing);
        $("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    }
}
