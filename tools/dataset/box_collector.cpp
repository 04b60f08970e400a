// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/box_collector.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

constexpr uint32_t kFirstFreeNumber = 1000; // above those of the tables
constexpr double kLeastUp = std::numbers::sqrt2 / 2;

} // namespace

Result<BoxCollector> BoxCollector::create(std::span<const SourceLabel> table, const Path& map, const Point3& origin)
{
    BoxCollector collector;
    collector.origin_ = origin;
    collector.labels_ = LabelMap(table);
    for (const SourceLabel& label : table)
        collector.numbers_.emplace(label.name, label.number);
    if (map.empty())
        return collector;
    SR_TRY(LabelTable overrides, read_label_table(map));
    overrides.whole = false;
    for (LabelTable::Label& label : overrides.labels)
        if (!label.name.empty()) { // boxes have names: numbers of a table of other files mean nothing here
            label.number.reset();
            collector.number_of(label.name);
        }
    SR_CHECK(collector.labels_.apply(overrides));
    return collector;
}

uint32_t BoxCollector::number_of(std::string_view label)
{
    const auto known = numbers_.find(label);
    if (known != numbers_.end())
        return known->second;
    const uint32_t number = kFirstFreeNumber + uint32_t(numbers_.size());
    numbers_.emplace(label, number);
    labels_.set(number, std::string(label), std::nullopt);
    return number;
}

Status BoxCollector::add(const ForeignBox& box, std::string_view where)
{
    const uint8_t label = labels_(number_of(box.label));
    if (label >= kClassCount)
        return {};
    if (box.pose[10] < kLeastUp) {
        ++tilted_;
        return {};
    }
    if (objects_.size() == kMaxObjects)
        return fail(ErrorCode::bad_input, "{}: expected at most {} objects, found more", where, kMaxObjects);
    SceneObject o{.id = uint32_t(objects_.size()), .label = label, .size = box.size, .tint = box.tint};
    for (size_t a = 0; a < 3; ++a)
        o.center[a] = box.pose[a * 4 + 3] + origin_[a];
    o.heading = std::atan2(box.pose[4], box.pose[0]);
    SR_CHECK(check_object(o, where));
    if (box.id && *box.id <= UINT32_MAX) {
        o.id = uint32_t(*box.id);
        if (!ids_.insert(*box.id).second && repeated_.empty())
            repeated_ = fmt::format("{}: id {} is given twice", where, *box.id);
    } else {
        all_have_ids_ = false;
    }
    objects_.push_back(std::move(o));
    return {};
}

Result<std::vector<SceneObject>> BoxCollector::finish(std::string_view where)
{
    SR_CHECK(labels_.check(where, "objects"));
    if (all_have_ids_ && !repeated_.empty())
        return fail(ErrorCode::bad_input, "{}", repeated_);
    if (!all_have_ids_)
        for (size_t i = 0; i < objects_.size(); ++i)
            objects_[i].id = uint32_t(i);
    return std::move(objects_);
}

std::vector<std::string> BoxCollector::warnings() const
{
    std::vector<std::string> lines = labels_.left_out("objects");
    if (tilted_)
        lines.push_back(fmt::format("{} objects that are tilted by more than 45 degrees are left out", tilted_));
    return lines;
}

} // namespace semrover
