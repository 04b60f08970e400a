// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <nlohmann/json_fwd.hpp>

// A JSON value that is destroyed first collects what lies below it in a std::vector of values (basic_json::destroy of
// 3.11), and a destructor that finds no memory ends the process. Where there is none these vectors take a reserve.
template <>
class std::allocator<nlohmann::json> {
  public:
    using value_type = nlohmann::json;
    using size_type = size_t;
    using difference_type = ptrdiff_t;
    using propagate_on_container_move_assignment = std::true_type;
    using is_always_equal = std::true_type;

    allocator() = default;
    template <typename Other>
    allocator(const allocator<Other>&)
    {
    }
    // memory for `count` values; std::bad_alloc where the reserve is used up, too
    nlohmann::json* allocate(size_t count);
    void deallocate(nlohmann::json* values, size_t count) noexcept;
};

#include <nlohmann/json.hpp> // from here on
