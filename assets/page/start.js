// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a part that fails leaves the others working
function begin(make) {
    try {
        return make();
    } catch (problem) {
        complain(problem.message);
        return null;
    }
}

const pageData = begin(() => JSON.parse($("page-data").textContent));
const player = pageData && $("player") && begin(() => new Player(pageData));
const orbit = pageData && begin(() => new Orbit(pageData));
publish();
if (asked.has("check"))
    check(player, orbit);
