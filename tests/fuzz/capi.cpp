// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// Calls of the C interface that need no device, in any order, with any arguments that its header allows: NULL, handles
// that live, arrays with as many elements as are said
#include "engine/semrover.h"
#include "tests/fuzz/fuzz_target.h"

#include <cstring>

namespace semrover::fuzz {

namespace capi_calls {

// takes numbers off the input, zeros at its end
class Numbers {
  public:
    explicit Numbers(Bytes bytes) : rest_(bytes) {}
    bool more() const { return !rest_.empty(); }
    template <typename T>
    T take()
    {
        T value{};
        const size_t size = std::min(sizeof value, rest_.size());
        std::memcpy(&value, rest_.data(), size);
        rest_ = rest_.subspan(size);
        return value;
    }
    Bytes rest() const { return rest_; }

  private:
    Bytes rest_;
};

// SR_OK, or an error that the header names
bool good(sr_status status)
{
    if (std::strcmp(sr_status_name(status), "unknown") == 0)
        found(fmt::format("status {} has no name", int(status)));
    if (status == SR_ERR_INTERNAL)
        found("SR_ERR_INTERNAL");
    return status == SR_OK;
}

struct Grids {
    sr_grid* grids[4] = {};
    ~Grids()
    {
        for (sr_grid* grid : grids)
            sr_grid_destroy(grid);
    }
};

void read_all(const sr_grid* grid)
{
    sr_grid_info info{};
    info.struct_size = sizeof info;
    if (!good(sr_grid_get_info(grid, &info)))
        return;
    std::vector<sr_cell> cells(info.cells);
    uint64_t written = 0;
    if (!good(sr_grid_get_cells(grid, 0, info.cells, cells.data(), &written)) || written != info.cells)
        found("a grid does not give the cells that it says it has");
    sr_grid* copy = nullptr;
    if (!good(sr_grid_create(info.voxel_size, &copy)) || !good(sr_grid_set_cells(copy, cells.data(), written)))
        found("cells of a grid are refused by another");
    sr_grid_destroy(copy);
    std::vector<float> points(info.cells * info.points_per_voxel * 6);
    if (good(sr_grid_get_points(grid, 0, info.cells, points.data(), &written)) != (info.points_per_voxel > 0))
        found("points that a grid says it has, or has not");
}

void call(Numbers& numbers, sr_grid*& grid)
{
    const auto what = numbers.take<uint8_t>();
    const auto count = numbers.take<uint8_t>() % 32;
    uint64_t written = 0;
    switch (what % 8) {
    case 0:
        sr_grid_destroy(grid);
        grid = nullptr;
        (void)good(sr_grid_create(numbers.take<double>(), &grid));
        break;
    case 1: {
        std::vector<sr_cell> cells(count);
        for (sr_cell& cell : cells)
            cell = what & 128 ? numbers.take<sr_cell>()
                              : sr_cell{numbers.take<int8_t>(), numbers.take<int8_t>(), numbers.take<int8_t>(),
                                        numbers.take<uint8_t>() % 21u == 20 ? SR_NO_CELL : 3u};
        (void)good(sr_grid_set_cells(grid, cells.data(), cells.size()));
        break;
    }
    case 2: {
        std::vector<sr_cell> cells(count);
        if (good(sr_grid_get_cells(grid, numbers.take<uint64_t>(), cells.size(), cells.data(), &written)) &&
            written > cells.size())
            found("more cells than there is room for");
        break;
    }
    case 3: {
        sr_grid_info info{};
        info.struct_size = sizeof info;
        if (!good(sr_grid_get_info(grid, &info)))
            break;
        std::vector<float> points(size_t(count) * info.points_per_voxel * 6);
        (void)good(sr_grid_get_points(grid, numbers.take<uint64_t>(), count, points.data(), &written));
        break;
    }
    case 4: {
        std::vector<std::byte> info(256);
        const auto size = numbers.take<uint32_t>() % 256;
        std::memcpy(info.data(), &size, sizeof size);
        (void)good(sr_grid_get_info(grid, reinterpret_cast<sr_grid_info*>(info.data())));
        break;
    }
    case 5:
        if (grid)
            read_all(grid);
        break;
    case 6: {
        uint8_t rgb[3];
        const auto number = numbers.take<uint32_t>();
        if (good(sr_class_color(number, rgb)) != (sr_class_name(number) != nullptr))
            found("a class with a colour and no name");
        break;
    }
    case 7: {
        char text[32];
        (void)sr_last_error(nullptr, count ? text : nullptr, count);
        break;
    }
    }
}

void capi_grids(Bytes input)
{
    Grids grids;
    Numbers numbers(input);
    while (numbers.more())
        call(numbers, grids.grids[numbers.take<uint8_t>() % 4]);
}

void capi_files(Bytes input)
{
    const InputFile file(input, "file");
    const std::string path = Path(file).string();
    sr_grid* grid = nullptr;
    if (good(sr_grid_read(path.c_str(), &grid)))
        read_all(grid);
    sr_grid_destroy(grid);
    uint64_t count = 0;
    if (good(sr_read_objects(path.c_str(), nullptr, &count))) {
        std::vector<sr_object> objects(count);
        (void)good(sr_read_objects(path.c_str(), objects.data(), &count));
    }
}

constexpr FuzzTarget kTargets[] = {
    {"capi_grids", "", capi_grids, 4096},
    {"capi_files", "*.sgrid *objects.json", capi_files},
};

} // namespace capi_calls

std::span<const FuzzTarget> capi_targets()
{
    return capi_calls::kTargets;
}

} // namespace semrover::fuzz
