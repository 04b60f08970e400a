// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/export/nuscenes_tables.h"

#include "runtime/base/hash.h"

namespace semrover {

namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr const char* kTables[] = {
    "attribute", "calibrated_sensor", "category",    "ego_pose", "instance", "log",       "map",
    "sample",    "sample_annotation", "sample_data", "scene",    "sensor",   "visibility"};

// by the index that lidarseg gives them, from 1
constexpr const char* kCategories[] = {
    "animal",
    "human.pedestrian.adult",
    "human.pedestrian.child",
    "human.pedestrian.construction_worker",
    "human.pedestrian.personal_mobility",
    "human.pedestrian.police_officer",
    "human.pedestrian.stroller",
    "human.pedestrian.wheelchair",
    "movable_object.barrier",
    "movable_object.debris",
    "movable_object.pushable_pullable",
    "movable_object.trafficcone",
    "static_object.bicycle_rack",
    "vehicle.bicycle",
    "vehicle.bus.bendy",
    "vehicle.bus.rigid",
    "vehicle.car",
    "vehicle.construction",
    "vehicle.emergency.ambulance",
    "vehicle.emergency.police",
    "vehicle.motorcycle",
    "vehicle.trailer",
    "vehicle.truck",
};

constexpr const char* kAttributes[] = {"vehicle.moving",      "vehicle.stopped",     "vehicle.parked",
                                       "cycle.with_rider",    "cycle.without_rider", "pedestrian.sitting_lying_down",
                                       "pedestrian.standing", "pedestrian.moving"};

struct Visibility {
    const char *token, *level, *description;
};
constexpr Visibility kVisibilities[] = {
    {"1", "v0-40", "visibility of whole object is between 0 and 40%"},
    {"2", "v40-60", "visibility of whole object is between 40 and 60%"},
    {"3", "v60-80", "visibility of whole object is between 60 and 80%"},
    {"4", "v80-100", "visibility of whole object is between 80 and 100%"},
};

} // namespace

NuscenesTables::NuscenesTables()
{
    for (const char* table : kTables)
        tables_[table] = OrderedJson::array();
    int index = 0;
    for (const char* name : kCategories)
        add("category", name, {{"name", name}, {"description", ""}, {"index", ++index}});
    for (const char* name : kAttributes)
        add("attribute", name, {{"name", name}, {"description", ""}});
    for (const Visibility& v : kVisibilities)
        tables_["visibility"].push_back({{"token", v.token}, {"level", v.level}, {"description", v.description}});
}

std::string NuscenesTables::token(const char* table, const std::string& key)
{
    std::string token;
    for (const char* half : {"first", "second"}) {
        Hash hash;
        hash.add(half);
        hash.add(table);
        hash.add(key);
        token += hash_text(hash.value());
    }
    return token;
}

std::string NuscenesTables::add(const char* table, const std::string& key, OrderedJson record)
{
    const std::string name = token(table, key);
    OrderedJson with_token{{"token", name}};
    with_token.update(record);
    tables_.at(table).push_back(std::move(with_token));
    return name;
}

void NuscenesTables::add_once(const char* table, const std::string& key, const OrderedJson& record)
{
    if (once_.insert(token(table, key)).second)
        add(table, key, record);
}

Status NuscenesTables::write(const Path& folder) const
{
    for (const auto& [table, records] : tables_)
        SR_CHECK(put_file(folder / (table + ".json"), json_text(records, 0) + "\n"));
    return {};
}

const char* nuscenes_category(uint8_t label)
{
    switch (label) {
    case 11:
        return "human.pedestrian.adult";
    case 12:
        return "human.pedestrian.personal_mobility";
    case 13:
        return "vehicle.car";
    case 14:
        return "vehicle.truck";
    case 15:
        return "vehicle.bus.rigid";
    case 17:
        return "vehicle.motorcycle";
    case 18:
        return "vehicle.bicycle";
    default:
        return nullptr;
    }
}

const char* nuscenes_attribute(uint8_t label, bool moves_now, bool moves)
{
    if (label == 11 || label == 12)
        return moves_now ? "pedestrian.moving" : "pedestrian.standing";
    if (label == 17 || label == 18)
        return moves_now ? "cycle.with_rider" : "cycle.without_rider";
    return moves_now ? "vehicle.moving" : moves ? "vehicle.stopped" : "vehicle.parked";
}

const char* nuscenes_visibility(double shown)
{
    return kVisibilities[shown < 0.4 ? 0 : shown < 0.6 ? 1 : shown < 0.8 ? 2 : 3].token;
}

} // namespace semrover
