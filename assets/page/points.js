// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a scene's points, out of the page: [n, 3] 16-bit positions in the scene's box, [n, 3] sRGB bytes, [n] labels
const kBytesAPoint = 10;

function readScene(scene, index) {
    const bytes = bytesOf(`points-${index}`), n = scene.count;
    if (bytes.length !== n * kBytesAPoint)
        throw new Error(`points-${index}: ${bytes.length} bytes, expected ${n * kBytesAPoint}`);
    const quantised = new Uint16Array(bytes.buffer, 0, 3 * n);
    const positions = new Float32Array(3 * n); // metres from the box's low corner: floats hold that anywhere
    for (let i = 0; i < 3 * n; ++i)
        positions[i] = quantised[i] * scene.step[i % 3];
    return { ...scene, quantised, positions, colors: bytes.subarray(6 * n, 9 * n), labels: bytes.subarray(9 * n) };
}
