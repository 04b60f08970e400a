// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// Waymo's labels of the lidar: a frame or a list of labels in protocol buffers' JSON, or the table of lidar boxes as
// text. Source: label.proto, dataset.proto and v2/perception/box.py of waymo-research/waymo-open-dataset
#include "runtime/base/quote.h"
#include "tools/dataset/object_boxes.h"
#include "tools/trajectory/camera_text.h"
#include "tools/trajectory/json_tables.h"

#include <charconv>
#include <cmath>

namespace semrover {

namespace {

constexpr size_t kMostColumns = 4096;

// The rows of a table as text: a line with names, then lines of values, with commas between. Values may stand in double
// quotes, but hold neither commas nor quotes. Views into the text.
class CsvRows {
  public:
    // reads the names; bad_input for names given twice, and for more than 4096
    static Result<CsvRows> open(std::string_view text, std::string_view where);

    std::optional<size_t> column(std::string_view name) const;
    Result<size_t> need(std::string_view name) const; // bad_input when there is no such column

    // To the first row, and on; false at the end. Skips empty lines. bad_input for a row with another number of values
    Result<bool> next();
    std::string_view value(size_t column) const { return values_[column]; }
    std::string where() const; // "'t.csv' line 3"

  private:
    CsvRows(std::string_view text, std::string_view where) : lines_(text), where_(where) {}
    Status split();

    TextLines lines_;
    std::string where_;
    std::vector<std::string_view> names_, values_;
};

Result<CsvRows> CsvRows::open(std::string_view text, std::string_view where)
{
    CsvRows rows(text, where);
    if (!rows.lines_.next())
        return fail(ErrorCode::bad_input, "{}: expected a line with the names of columns, found nothing", where);
    SR_CHECK(rows.split());
    rows.names_ = rows.values_;
    for (size_t i = 0; i < rows.names_.size(); ++i)
        if (rows.column(rows.names_[i]) != i)
            return fail(ErrorCode::bad_input, "{}: column {} is given twice", rows.where(), quote(rows.names_[i], 60));
    return rows;
}

std::string CsvRows::where() const
{
    return fmt::format("{} line {}", where_, lines_.number());
}

std::optional<size_t> CsvRows::column(std::string_view name) const
{
    const auto found = std::ranges::find(names_, name);
    if (found == names_.end())
        return std::nullopt;
    return size_t(found - names_.begin());
}

Result<size_t> CsvRows::need(std::string_view name) const
{
    if (const auto at = column(name))
        return *at;
    return fail(ErrorCode::bad_input, "{}: there is no column {}", where_, name);
}

Status CsvRows::split()
{
    values_.clear();
    std::string_view line = lines_.line();
    if (line.ends_with('\r'))
        line.remove_suffix(1);
    for (bool more = true; more;) {
        const size_t comma = line.find(',');
        std::string_view value = line.substr(0, comma);
        more = comma != std::string_view::npos;
        line.remove_prefix(more ? comma + 1 : line.size());
        if (value.size() >= 2 && value.starts_with('"') && value.ends_with('"'))
            value = value.substr(1, value.size() - 2);
        if (value.find('"') != std::string_view::npos)
            return fail(ErrorCode::bad_input, "{}: a value with a quote or a comma inside: {}", where(),
                        quote(value, 60));
        if (values_.size() == kMostColumns)
            return fail(ErrorCode::bad_input, "{}: expected at most {} values, found more", where(), kMostColumns);
        values_.push_back(value);
    }
    return {};
}

Result<bool> CsvRows::next()
{
    do {
        if (!lines_.next())
            return false;
    } while (count_words(lines_.line()) == 0);
    SR_CHECK(split());
    if (values_.size() != names_.size())
        return fail(ErrorCode::bad_input, "{}: expected {} values, found {}", where(), names_.size(), values_.size());
    return true;
}

constexpr SourceLabel kWaymoLabels[] = {
    {0, "TYPE_UNKNOWN", kLeftOut}, {1, "TYPE_VEHICLE", 13}, {2, "TYPE_PEDESTRIAN", 11},
    {3, "TYPE_SIGN", 7},           {4, "TYPE_CYCLIST", 12},
};

constexpr uint64_t kMaxWaymoBytes = 256u << 20;

// protocol buffers' JSON has either name
const Json* find_field(const Json& object, const char* camel, const char* snake)
{
    for (const char* key : {camel, snake})
        if (const auto entry = object.find(key); entry != object.end() && !entry->is_null())
            return &*entry;
    return nullptr;
}

std::string type_of_number(double number)
{
    for (const SourceLabel& label : kWaymoLabels)
        if (number == label.number)
            return std::string(label.name);
    return fmt::format("type {}", number);
}

Rigid upright_pose(const Point3& center, double heading)
{
    const double c = std::cos(heading), s = std::sin(heading);
    return {c, -s, 0, center[0], s, c, 0, center[1], 0, 0, 1, center[2], 0, 0, 0, 1};
}

Result<std::string> type_of(const Json& label, std::string_view where)
{
    const Json* type = find_field(label, "type", "type");
    if (!type)
        return std::string(kWaymoLabels[0].name);
    if (type->is_string())
        return type->get<std::string>();
    SR_TRY(const double number, finite_number(*type, fmt::format("{}: type", where)));
    return type_of_number(number);
}

Status add_label(const Json& label, const Rigid& to_frame, std::string_view where, BoxCollector& to)
{
    const Json* box = label.is_object() ? find_field(label, "box", "box") : nullptr;
    if (!box || !box->is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object with a box", where);
    constexpr std::pair<const char*, const char*> kFields[] = {
        {"centerX", "center_x"}, {"centerY", "center_y"}, {"centerZ", "center_z"}, {"length", "length"},
        {"width", "width"},      {"height", "height"},    {"heading", "heading"}};
    std::array<double, 7> v{}; // what a message leaves out is 0
    for (size_t i = 0; i < v.size(); ++i)
        if (const Json* value = find_field(*box, kFields[i].first, kFields[i].second)) {
            SR_TRY(v[i], finite_number(*value, fmt::format("{}: box: {}", where, kFields[i].first)));
        }
    SR_TRY(const std::string type, type_of(label, where));
    const Rigid pose = compose(to_frame, upright_pose({v[0], v[1], v[2]}, v[6]));
    return to.add({.label = type, .pose = pose, .size = {v[3], v[4], v[5]}}, where);
}

Result<Rigid> vehicle_to_world(const Json& frame, std::string_view name)
{
    const Json* pose = find_field(frame, "pose", "pose");
    const Json* transform = pose && pose->is_object() ? find_field(*pose, "transform", "transform") : nullptr;
    if (!pose)
        return kIdentity;
    const std::string where = fmt::format("{}: pose: transform", name);
    if (!transform)
        return fail(ErrorCode::bad_input, "{}: expected 16 numbers", where);
    SR_TRY(const std::vector<double> values, numbers_of(*transform, where));
    return rigid_from_matrix(values, where);
}

Status read_json_labels(const Path& path, const BoxOptions& options, BoxCollector& to)
{
    const std::string name = quote_path(path);
    SR_TRY(const Json file, read_json(path, {.bytes = kMaxWaymoBytes, .values = 32u << 20, .containers = 4u << 20}));
    const Json* labels = file.is_array() ? &file : nullptr;
    Rigid to_frame = kIdentity;
    if (file.is_object()) {
        labels = find_field(file, "laserLabels", "laser_labels");
        if (!options.vehicle_frame) {
            SR_TRY(to_frame, vehicle_to_world(file, name));
        }
    }
    if (!labels || !labels->is_array())
        return fail(ErrorCode::bad_input, "{}: expected an array of labels, or an object with one as laserLabels",
                    name);
    if (options.frame)
        return fail(ErrorCode::usage, "{}: `frame` is for tables, this is one frame", name);
    for (size_t i = 0; i < labels->size(); ++i)
        SR_CHECK(add_label((*labels)[i], to_frame, fmt::format("{} label {}", name, i), to));
    return {};
}

struct WaymoColumns {
    size_t frame, type;
    std::array<size_t, 7> box;
    std::optional<size_t> segment;
};

Result<WaymoColumns> columns_of(const CsvRows& rows)
{
    constexpr const char* kBox[] = {"center.x", "center.y", "center.z", "size.x", "size.y", "size.z", "heading"};
    WaymoColumns c{};
    for (size_t i = 0; i < c.box.size(); ++i) {
        SR_TRY(c.box[i], rows.need(fmt::format("[LiDARBoxComponent].box.{}", kBox[i])));
    }
    SR_TRY(c.type, rows.need("[LiDARBoxComponent].type"));
    SR_TRY(c.frame, rows.need("key.frame_timestamp_micros"));
    c.segment = rows.column("key.segment_context_name");
    return c;
}

Result<uint64_t> timestamp_of(std::string_view text, std::string_view where)
{
    uint64_t time = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), time);
    if (error != std::errc() || end != text.data() + text.size())
        return fail(ErrorCode::bad_input, "{}: expected a timestamp in microseconds, found {}", where, quote(text, 40));
    return time;
}

Status add_row(const CsvRows& rows, const WaymoColumns& columns, BoxCollector& to)
{
    const std::string where = rows.where();
    std::array<double, 7> v{};
    for (size_t i = 0; i < v.size(); ++i) {
        SR_TRY(v[i], number_of(rows.value(columns.box[i]), where));
        if (!std::isfinite(v[i]))
            return fail(ErrorCode::bad_input, "{}: a number that is not finite", where);
    }
    std::string type(rows.value(columns.type));
    if (const Result<double> number = number_of(type, where))
        type = type_of_number(*number);
    return to.add({.label = type, .pose = upright_pose({v[0], v[1], v[2]}, v[6]), .size = {v[3], v[4], v[5]}}, where);
}

Status read_table(const Path& path, const BoxOptions& options, BoxCollector& to)
{
    const std::string name = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxWaymoBytes));
    SR_TRY(CsvRows rows, CsvRows::open(text, name));
    SR_TRY(const WaymoColumns columns, columns_of(rows));
    std::optional<uint64_t> frame = options.frame;
    std::optional<std::string_view> segment;
    for (;;) {
        SR_TRY(const bool more, rows.next());
        if (!more)
            break;
        SR_TRY(const uint64_t time, timestamp_of(rows.value(columns.frame), rows.where()));
        if (!frame)
            frame = time;
        if (time != *frame && options.frame)
            continue;
        if (time != *frame)
            return fail(ErrorCode::bad_input, "{}: frame {} after frame {}: choose one with `frame`", rows.where(),
                        time, *frame);
        if (columns.segment && segment.value_or(rows.value(*columns.segment)) != rows.value(*columns.segment))
            return fail(ErrorCode::bad_input, "{}: another segment: expected a table of one", rows.where());
        segment = columns.segment ? rows.value(*columns.segment) : "";
        SR_CHECK(add_row(rows, columns, to));
    }
    if (options.frame && !segment)
        return fail(ErrorCode::bad_input, "{}: there is no frame {}", name, *options.frame);
    return {};
}

} // namespace

std::span<const SourceLabel> waymo_box_labels()
{
    return kWaymoLabels;
}

Status read_waymo_boxes(const Path& path, const BoxOptions& options, BoxCollector& to)
{
    return path.extension() == ".csv" ? read_table(path, options, to) : read_json_labels(path, options, to);
}

} // namespace semrover
