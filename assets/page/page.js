// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what the parts of the page share: the data that lies in it, what went wrong, and the report for who reads the page
// by machine (the attribute data-report of <html>)
const $ = (id) => document.getElementById(id);

const report = { errors: [], frames: 0, points: 0, renderer: "none" };

function publish() {
    document.documentElement.dataset.report = JSON.stringify(report);
}

function complain(what) {
    report.errors.push(String(what));
    publish();
    const note = $("trouble");
    note.hidden = false;
    note.textContent = "Something on this page does not work: " + what;
}

window.addEventListener("error", ({ message }) => complain(message));
window.addEventListener("unhandledrejection", ({ reason }) => complain(reason && reason.message || reason));

// #canvas, #check: words after the address, for tests
const asked = new Set(location.hash.slice(1).split(","));
const quietMotion = window.matchMedia("(prefers-reduced-motion: reduce)").matches;

function bytesOf(id) {
    const text = atob($(id).textContent);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i)
        bytes[i] = text.charCodeAt(i);
    return bytes;
}

function element(name, properties, ...children) {
    const node = Object.assign(document.createElement(name), properties);
    node.append(...children);
    return node;
}

// a pointer that the browser does not know (a test's) cannot be captured
function capture(node, event) {
    try {
        node.setPointerCapture(event.pointerId);
    } catch {
        return;
    }
}

const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
