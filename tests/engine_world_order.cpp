// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
// the order in which the tiles of foci and tracks are wanted
#include "tests/support/world_case.h"

namespace semrover {
namespace engine_world_order_test {

using namespace world_case;

TEST(engine_world_order, a_focus_finds_its_tiles_nearest_first_and_counts_them_before)
{
    for (const double radius : {0., 1., 7.3, 40.})
        for (const double direction : {0., 1.}) {
            const WorldFocus focus{
                .position = {3.1, -7.9, 1}, .direction = {direction, -0.3 * direction, 0}, .radius = radius};
            TileOrder order({focus}, 3.6);
            const size_t size = order.size();
            std::set<TileIndex> expected, found;
            for (int32_t x = -15; x < 16; ++x)
                for (int32_t y = -15; y < 16; ++y)
                    if (distance_to_tile(GroundPoint{3.1, -7.9}, {x, y}, 3.6) <= radius)
                        expected.insert({x, y});
            double last = 0;
            for (size_t rank = 0; const auto tile = order.at(rank); ++rank) {
                EXPECT_TRUE(found.insert(*tile).second);
                EXPECT_EQ(order.rank_of(*tile), rank);
                const double x = ((*tile)[0] + 0.5) * 3.6 - 3.1, y = ((*tile)[1] + 0.5) * 3.6 + 7.9;
                const double length = std::hypot(direction, 0.3 * direction);
                const double ahead = length > 0 ? (x - 0.3 * y) * direction / (std::hypot(x, y) * length) : 1;
                const double weight = std::hypot(x, y) * (2 - ahead);
                EXPECT_GE(weight, last - 1e-9) << rank;
                last = weight;
            }
            EXPECT_EQ(found, expected);
            EXPECT_EQ(size, expected.size());
            EXPECT_EQ(order.size(), expected.size());
        }
}

// brute force over all tiles; two disks that overlap, one within another, one far from all
TEST(engine_world_order, several_foci_find_the_tiles_of_each_once_nearest_to_any_first)
{
    const WorldFoci foci = {{.position = {3.1, -7.9, 1}, .direction = {1, -0.3, 0}, .radius = 12},
                            {.position = {13, -2, 0}, .direction = {0, 0, 0}, .radius = 9},
                            {.position = {4, -6, 0}, .direction = {0, 0, 0}, .radius = 2},
                            {.position = {-200, 40, 3}, .direction = {0, 2, 0}, .radius = 7.3}};
    std::map<TileIndex, double> expected; // with the weight of the nearest focus
    for (int32_t x = -70; x < 16; ++x)
        for (int32_t y = -15; y < 20; ++y)
            for (const WorldFocus& focus : foci) {
                const double px = focus.position[0], py = focus.position[1];
                const double left = x * 3.6, low = y * 3.6;
                const double dx = std::max({0., left - px, px - left - 3.6});
                const double dy = std::max({0., low - py, py - low - 3.6});
                if (std::hypot(dx, dy) > focus.radius)
                    continue;
                const double mx = left + 1.8 - px, my = low + 1.8 - py, away = std::hypot(mx, my);
                const double length = std::hypot(focus.direction[0], focus.direction[1]);
                const double ahead = (mx * focus.direction[0] + my * focus.direction[1]) / (away * length);
                const double weight = length > 0 ? away * (2 - ahead) : away;
                const auto [entry, added] = expected.emplace(TileIndex{x, y}, weight);
                entry->second = std::min(entry->second, weight);
            }
    TileOrder order(foci, 3.6);
    EXPECT_EQ(order.size(), expected.size());
    double last = 0;
    size_t count = 0;
    for (; const auto tile = order.at(count); ++count) {
        ASSERT_TRUE(expected.contains(*tile));
        EXPECT_EQ(order.rank_of(*tile), count);
        EXPECT_NEAR(expected.at(*tile), std::max(expected.at(*tile), last), 1e-9) << count;
        last = expected.at(*tile);
    }
    EXPECT_EQ(count, expected.size());
    EXPECT_EQ(order.size(), expected.size());
}

TEST(engine_world_order, tiles_along_a_track_are_those_within_the_horizon_in_the_order_of_the_way)
{
    const std::vector<GroundPoint> track = {{-10, 2}, {7, 2}, {12, 14}, {12, -9}};
    for (const double horizon : {0.2, 5.}) {
        const std::vector<TileIndex> tiles = tiles_along(track, horizon, 3.6);
        const std::set<TileIndex> found(tiles.begin(), tiles.end());
        EXPECT_EQ(found.size(), tiles.size());
        for (int32_t x = -10; x < 10; ++x)
            for (int32_t y = -10; y < 10; ++y) {
                double nearest = 1e9;
                for (size_t i = 0; i + 1 < track.size(); ++i)
                    for (double t = 0; t <= 1; t += 1. / 4096)
                        nearest = std::min(
                            nearest, distance_to_tile(GroundPoint{track[i][0] + t * (track[i + 1][0] - track[i][0]),
                                                                  track[i][1] + t * (track[i + 1][1] - track[i][1])},
                                                      {x, y}, 3.6));
                if (std::abs(nearest - horizon) > 0.01) {
                    EXPECT_EQ(found.contains({x, y}), nearest < horizon) << x << ", " << y;
                }
            }
        const auto rank = [&](const TileIndex& tile) { return std::ranges::find(tiles, tile) - tiles.begin(); };
        EXPECT_LT(rank({-3, 0}), rank({0, 0}));
        EXPECT_LT(rank({0, 0}), rank({3, 3}));
        EXPECT_LT(rank({3, 3}), rank({3, -2}));
    }
    EXPECT_EQ(tiles_along({{{1, 1}}}, 0.5, 3.6), (std::vector<TileIndex>{{0, 0}}));
}

} // namespace engine_world_order_test
} // namespace semrover
