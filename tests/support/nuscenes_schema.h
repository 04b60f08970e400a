// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "runtime/base/json.h"

#include <cmath>
#include <map>
#include <set>

namespace semrover {

// Checks a folder of nuScenes v1.0 against its schema, a line a fault: the fields of all 13 tables and their types,
// tokens, foreign keys, masks of maps, pictures, times, rows of `prev` and `next`, and what the devkit asks for when it
// loads a data set. Source: the page schema_nuscenes.md and python-sdk/nuscenes/nuscenes.py of
// https://github.com/nutonomy/nuscenes-devkit
class NuscenesSchema {
  public:
    static std::vector<std::string> faults(const Path& root, const std::string& version)
    {
        NuscenesSchema schema(root);
        if (schema.load(root / version)) {
            schema.check_keys();
            if (schema.faults_.empty()) { // what follows goes along keys
                schema.check_rows();
                schema.check_scenes();
                schema.check_data();
                schema.check_annotations();
                schema.check_maps();
            }
        }
        return schema.faults_;
    }
    static Json table(const Path& folder, const std::string& name)
    {
        return read_json(folder / (name + ".json")).value();
    }

  private:
    enum Kind { text, number, whole, flag, three, four, matrix, keys };
    struct Field {
        const char* name;
        Kind kind;
        const char* to = nullptr; // of a foreign key: its table
        bool may_be_empty = false;
    };
    static const std::map<std::string, std::vector<Field>>& fields()
    {
        static const std::map<std::string, std::vector<Field>> all = {
            {"attribute", {{"name", text}, {"description", text}}},
            {"calibrated_sensor",
             {{"sensor_token", text, "sensor"},
              {"translation", three},
              {"rotation", four},
              {"camera_intrinsic", matrix}}},
            {"category", {{"name", text}, {"description", text}, {"index", whole}}},
            {"ego_pose", {{"translation", three}, {"rotation", four}, {"timestamp", whole}}},
            {"instance",
             {{"category_token", text, "category"},
              {"nbr_annotations", whole},
              {"first_annotation_token", text, "sample_annotation"},
              {"last_annotation_token", text, "sample_annotation"}}},
            {"log", {{"logfile", text}, {"vehicle", text}, {"date_captured", text}, {"location", text}}},
            {"map", {{"log_tokens", keys, "log"}, {"category", text}, {"filename", text}}},
            {"sample",
             {{"timestamp", whole},
              {"scene_token", text, "scene"},
              {"next", text, "sample", true},
              {"prev", text, "sample", true}}},
            {"sample_annotation",
             {{"sample_token", text, "sample"},
              {"instance_token", text, "instance"},
              {"attribute_tokens", keys, "attribute"},
              {"visibility_token", text, "visibility", true},
              {"translation", three},
              {"size", three},
              {"rotation", four},
              {"num_lidar_pts", whole},
              {"num_radar_pts", whole},
              {"next", text, "sample_annotation", true},
              {"prev", text, "sample_annotation", true}}},
            {"sample_data",
             {{"sample_token", text, "sample"},
              {"ego_pose_token", text, "ego_pose"},
              {"calibrated_sensor_token", text, "calibrated_sensor"},
              {"filename", text},
              {"fileformat", text},
              {"width", whole},
              {"height", whole},
              {"timestamp", whole},
              {"is_key_frame", flag},
              {"next", text, "sample_data", true},
              {"prev", text, "sample_data", true}}},
            {"scene",
             {{"name", text},
              {"description", text},
              {"log_token", text, "log"},
              {"nbr_samples", whole},
              {"first_sample_token", text, "sample"},
              {"last_sample_token", text, "sample"}}},
            {"sensor", {{"channel", text}, {"modality", text}}},
            {"visibility", {{"level", text}, {"description", text}}},
        };
        return all;
    }

    explicit NuscenesSchema(const Path& root) : root_(root) {}

    template <typename... Args>
    void fault(fmt::format_string<Args...> what, Args&&... args)
    {
        if (faults_.size() < 50)
            faults_.push_back(fmt::format(what, std::forward<Args>(args)...));
    }

    bool load(const Path& folder)
    {
        for (const auto& [name, list] : fields()) {
            const auto json = read_json(folder / (name + ".json"));
            if (!json || !json->is_array()) {
                fault("{}: no table", name);
                return false;
            }
            for (const Json& record : *json) {
                const std::string token = record.value("token", "");
                if (token.empty() || !records_[name].emplace(token, record).second)
                    fault("{}: token {} is empty or there twice", name, token);
                if (record.size() != list.size() + 1)
                    fault("{} {}: {} fields, expected {}", name, token, record.size(), list.size() + 1);
                for (const Field& field : list)
                    check_field(name, record, field);
            }
        }
        return faults_.empty();
    }

    static bool numbers(const Json& value, size_t count)
    {
        return value.is_array() && value.size() == count &&
               std::all_of(value.begin(), value.end(), [](const Json& v) { return v.is_number(); });
    }
    void check_field(const std::string& table, const Json& record, const Field& field)
    {
        const Json value = record.value(field.name, Json());
        bool good = false;
        switch (field.kind) {
        case text:
            good = value.is_string() && (field.may_be_empty || field.to == nullptr || value != "");
            break;
        case number:
            good = value.is_number();
            break;
        case whole:
            good = value.is_number_integer();
            break;
        case flag:
            good = value.is_boolean();
            break;
        case three:
            good = numbers(value, 3);
            break;
        case four:
            good = numbers(value, 4) && std::abs(std::hypot(std::hypot(double(value[0]), double(value[1])),
                                                            std::hypot(double(value[2]), double(value[3]))) -
                                                 1) < 1e-9;
            break;
        case matrix:
            good = value.is_array() && (value.empty() || (value.size() == 3 && numbers(value[0], 3) &&
                                                          numbers(value[1], 3) && numbers(value[2], 3)));
            break;
        case keys:
            good = value.is_array();
            break;
        }
        if (!good)
            fault("{} {}: {} is {}", table, record.value("token", ""), field.name, value.dump());
    }

    const Json* find(const std::string& table, const Json& token) const
    {
        const auto found = records_.at(table).find(token.get<std::string>());
        return found == records_.at(table).end() ? nullptr : &found->second;
    }
    std::map<std::string, Json>& all(const std::string& table) { return records_[table]; }

    void check_keys()
    {
        for (const auto& [name, list] : fields())
            for (const auto& [token, record] : all(name))
                for (const Field& field : list) {
                    if (!field.to)
                        continue;
                    const Json value = field.kind == keys ? record[field.name] : Json::array({record[field.name]});
                    for (const Json& key : value)
                        if (!(field.may_be_empty && key == "") && !find(field.to, key))
                            fault("{} {}: {} leads nowhere", name, token, field.name);
                }
    }

    // `next` of a record leads to one whose `prev` leads back, later in time
    void check_rows()
    {
        for (const char* name : {"sample", "sample_data", "sample_annotation"})
            for (const auto& [token, record] : all(name)) {
                for (const auto& [there, back] : {std::pair("next", "prev"), std::pair("prev", "next")})
                    if (const Json* other = record[there] == "" ? nullptr : find(name, record[there]))
                        if ((*other)[back] != token)
                            fault("{} {}: {} of its {} is another", name, token, back, there);
                const Json* next = record["next"] == "" ? nullptr : find(name, record["next"]);
                if (next && next->contains("timestamp") && (*next)["timestamp"] <= record["timestamp"])
                    fault("{} {}: next is not later", name, token);
            }
    }

    void check_scenes()
    {
        for (const auto& [token, scene] : all("scene")) {
            size_t count = 0;
            const Json* last = nullptr;
            for (const Json* s = find("sample", scene["first_sample_token"]); s;
                 s = (*s)["next"] == "" ? nullptr : find("sample", (*s)["next"])) {
                if ((*s)["scene_token"] != token || (!last && (*s)["prev"] != ""))
                    fault("scene {}: sample {} is not of it, or not its first", token, (*s)["token"].dump());
                last = s;
                if (++count > all("sample").size())
                    break;
            }
            if (!last || (*last)["token"] != scene["last_sample_token"] || scene["nbr_samples"] != count)
                fault("scene {}: {} samples, and another last one", token, count);
        }
    }

    void check_data()
    {
        std::map<std::pair<std::string, std::string>, int> key_frames; // of a sample and channel
        std::set<std::string> files;
        std::map<std::string, std::set<std::string>> channels; // of each scene
        for (const auto& [token, data] : all("sample_data")) {
            const Json& sample = *find("sample", data["sample_token"]);
            const Json& calibrated = *find("calibrated_sensor", data["calibrated_sensor_token"]);
            const Json& sensor = *find("sensor", calibrated["sensor_token"]);
            const std::string channel = sensor["channel"], file = data["filename"];
            channels[sample["scene_token"]].insert(channel);
            if (!files.insert(file).second || !std::filesystem::is_regular_file(root_ / file))
                fault("sample_data {}: {} is missing, or there twice", token, file);
            const std::string folder = std::string(data["is_key_frame"] ? "samples/" : "sweeps/") + channel + "/";
            if (!file.starts_with(folder))
                fault("sample_data {}: {} is not in {}", token, file, folder);
            if ((*find("ego_pose", data["ego_pose_token"]))["timestamp"] != data["timestamp"])
                fault("sample_data {}: its pose is of another time", token);
            const int64_t apart = int64_t(data["timestamp"]) - int64_t(sample["timestamp"]);
            if (data["is_key_frame"] && std::abs(apart) > 50000)
                fault("sample_data {}: a key frame {} us from its sample", token, apart);
            if (!data["is_key_frame"] && apart > 0 && sample["next"] != "")
                fault("sample_data {}: its sample is not the one that follows", token);
            key_frames[{data["sample_token"], channel}] += data["is_key_frame"] ? 1 : 0;
            if (sensor["modality"] == "camera")
                check_picture(token, data, calibrated);
        }
        for (const auto& [token, sample] : all("sample"))
            for (const std::string& channel : channels[sample["scene_token"]])
                if (key_frames[{token, channel}] != 1)
                    fault("sample {}: {} key frames of {}", token, key_frames[{token, channel}], channel);
    }
    void check_picture(const std::string& token, const Json& data, const Json& calibrated)
    {
        const auto size = read_image_size(root_ / data["filename"].get<std::string>());
        if (!size || size->width != data["width"] || size->height != data["height"])
            fault("sample_data {}: its picture has another size", token);
        const Json& k = calibrated["camera_intrinsic"];
        if (k.empty() || k[0][1] != 0 || k[1][0] != 0 || k[2] != Json::array({0, 0, 1}) || !(k[0][0] > 0))
            fault("sample_data {}: camera_intrinsic is {}", token, k.dump());
    }

    void check_annotations()
    {
        std::set<std::pair<std::string, std::string>> seen;
        std::map<std::string, size_t> counts;
        for (const auto& [token, a] : all("sample_annotation")) {
            if (!seen.emplace(a["sample_token"], a["instance_token"]).second)
                fault("sample_annotation {}: a second one of its instance and sample", token);
            ++counts[a["instance_token"]];
            for (const Json& metres : a["size"])
                if (!(metres > 0))
                    fault("sample_annotation {}: size {}", token, a["size"].dump());
            const Json* next = a["next"] == "" ? nullptr : find("sample_annotation", a["next"]);
            if (next && (*next)["instance_token"] != a["instance_token"])
                fault("sample_annotation {}: next is of another instance", token);
            const auto time = [&](const Json& of) { return (*find("sample", of["sample_token"]))["timestamp"]; };
            if (next && time(*next) <= time(a))
                fault("sample_annotation {}: next is not later", token);
        }
        for (const auto& [token, instance] : all("instance")) {
            const Json& first = *find("sample_annotation", instance["first_annotation_token"]);
            const Json& last = *find("sample_annotation", instance["last_annotation_token"]);
            if (counts[token] != instance["nbr_annotations"] || first["prev"] != "" || last["next"] != "" ||
                first["instance_token"] != token || last["instance_token"] != token)
                fault("instance {}: its annotations are not as it says", token);
        }
    }

    // every log has a map, whose mask is a gray picture; all that is annotated or driven lies on it
    void check_maps()
    {
        constexpr double kMetres = 0.1;
        std::map<std::string, ImageSize> of_log;
        for (const auto& [token, map] : all("map")) {
            const auto bytes = MappedFile::open(root_ / map["filename"].get<std::string>());
            const auto info = bytes ? png_info(bytes->bytes(), "") : tl::make_unexpected(bytes.error());
            if (!info || info->kind != PngKind::gray || info->bits != 8 || map["category"] != "semantic_prior") {
                fault("map {}: its mask is no gray picture", token);
                continue;
            }
            for (const Json& log : map["log_tokens"])
                of_log[log] = info->size;
        }
        for (const auto& [token, log] : all("log"))
            if (!of_log.contains(token))
                fault("log {}: no map", token);
        for (const auto& [token, data] : all("sample_data")) {
            const Json& scene = *find("scene", (*find("sample", data["sample_token"]))["scene_token"]);
            const Json at = (*find("ego_pose", data["ego_pose_token"]))["translation"];
            const ImageSize size = of_log[scene["log_token"]];
            if (!(at[0] >= 0 && at[0] < size.width * kMetres && at[1] >= 0 && at[1] < size.height * kMetres))
                fault("sample_data {}: the vehicle is beside the map", token);
        }
    }

    Path root_;
    std::map<std::string, std::map<std::string, Json>> records_;
    std::vector<std::string> faults_;
};

} // namespace semrover
