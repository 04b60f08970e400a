// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/pattern.h"

#include "runtime/base/result.h"
#include "tools/streets/pattern_canvas.h"

namespace semrover {

namespace {

using Painter = void (*)(PatternCanvas&, Pattern);

struct Entry {
    PatternInfo info;
    Painter painter;
};

constexpr Entry kEntries[] = {
    {{"asphalt", 5, 512, 0.02f}, paint::ground},
    {{"road paint", 2, 128, 0.03f}, paint::ground},
    {{"slabs", 2.4, 256}, paint::ground},
    {{"setts", 1.2, 256}, paint::ground},
    {{"kerb", 2, 128}, paint::ground},
    {{"grass", 3, 256}, paint::ground},
    {{"earth", 2, 128}, paint::ground},
    {{"gravel", 2, 128}, paint::ground},
    {{"brick", 1.8, 256}, paint::wall},
    {{"plaster", 5, 256}, paint::wall},
    {{"concrete", 4, 256}, paint::wall},
    {{"ashlar", 2.4, 256}, paint::wall},
    {{"planks", 1.6, 128}, paint::wall},
    {{"roof tiles", 1.8, 128}, paint::wall},
    {{"slate", 1.8, 128}, paint::wall},
    {{"trim", 2, 64, 0.02f}, paint::wall},
    {{"metal", 1, 64, 0.08f}, paint::wall},
    {{"pane, dark", 1, 64, 0.09f}, paint::opening},
    {{"pane with curtain", 1, 128, 0.06f}, paint::opening},
    {{"pane with blind", 1, 128, 0.06f}, paint::opening},
    {{"pane, lit", 1, 128, 0.06f}, paint::opening},
    {{"office glass", 1, 128, 0.16f}, paint::opening},
    {{"shop window", 1, 256, 0.05f}, paint::opening},
    {{"shop window 2", 1, 256, 0.05f}, paint::opening},
    {{"door", 1, 128, 0.02f}, paint::opening},
    {{"glass door", 1, 128, 0.05f}, paint::opening},
    {{"garage door", 1, 128, 0.02f}, paint::opening},
    {{"shutter", 0.6, 64}, paint::opening},
    {{"shop sign", 1, 256, 0.02f}, paint::sign},
    {{"shop sign 2", 1, 256, 0.02f}, paint::sign},
    {{"shop sign 3", 1, 256, 0.02f}, paint::sign},
    {{"awning", 1.2, 64}, paint::opening},
    {{"poster", 1, 128, 0.04f}, paint::sign},
    {{"poster 2", 1, 128, 0.04f}, paint::sign},
    {{"bark", 0.8, 128}, paint::plant},
    {{"leaves", 0.7, 256}, paint::plant},
    {{"hedge", 1.2, 256}, paint::plant},
    {{"car paint", 1, 32, 0.05f}, paint::vehicle},
    {{"car side", 1, 256, 0.05f}, paint::vehicle},
    {{"car glass", 1, 32, 0.12f}, paint::vehicle},
    {{"rubber", 0.5, 32}, paint::vehicle},
    {{"rim", 1, 64, 0.08f}, paint::vehicle},
    {{"headlight", 1, 32, 0.12f}, paint::vehicle},
    {{"taillight", 1, 32, 0.06f}, paint::vehicle},
    {{"grille", 1, 64, 0.03f}, paint::vehicle},
    {{"plate", 1, 64}, paint::vehicle},
    {{"bus side", 1, 512, 0.06f}, paint::vehicle},
    {{"train side", 1, 512, 0.06f}, paint::vehicle},
    {{"cargo", 2.5, 128, 0.02f}, paint::vehicle},
    {{"fabric", 0.5, 64}, paint::vehicle},
    {{"skin", 0.5, 32}, paint::vehicle},
    {{"sign: stop", 1, 128, 0.02f}, paint::sign},
    {{"sign: yield", 1, 128, 0.02f}, paint::sign},
    {{"sign: speed", 1, 128, 0.02f}, paint::sign},
    {{"sign: no entry", 1, 64, 0.02f}, paint::sign},
    {{"sign: parking", 1, 64, 0.02f}, paint::sign},
    {{"sign: crossing", 1, 128, 0.02f}, paint::sign},
    {{"sign: priority", 1, 64, 0.02f}, paint::sign},
    {{"street name", 1, 128, 0.02f}, paint::sign},
    {{"lamp, red", 1, 32, 0.04f}, paint::sign},
    {{"lamp, amber", 1, 32, 0.04f}, paint::sign},
    {{"lamp, green", 1, 32, 0.04f}, paint::sign},
};
static_assert(std::size(kEntries) == size_t(Pattern::count));

const Entry& entry_of(Pattern pattern)
{
    SR_ASSERT(pattern < Pattern::count, "pattern {}", int(pattern));
    return kEntries[size_t(pattern)];
}

} // namespace

const PatternInfo& pattern_info(Pattern pattern)
{
    return entry_of(pattern).info;
}

ImageRgb8 paint_pattern(Pattern pattern)
{
    const Entry& e = entry_of(pattern);
    PatternCanvas canvas(e.info.pixels);
    e.painter(canvas, pattern);
    return canvas.image();
}

} // namespace semrover
