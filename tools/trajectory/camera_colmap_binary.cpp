// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// COLMAP's binary models, which it writes by default. Little endian, without padding.
// Source: https://colmap.github.io/format.html, and src/colmap/scene/reconstruction_io_binary.cc of its sources
#include "tools/trajectory/colmap_models.h"

#include "runtime/base/quote.h"

#include <bit>
#include <cstring>

namespace semrover {

static_assert(std::endian::native == std::endian::little);

namespace {

constexpr size_t kLongestName = 4096;
constexpr uint64_t kPointBytes = 24; // of a point of a picture: x, y, number of the point in space

// numbers one after the other; the first that is not there is an error, and those after it are 0
class ColmapBytes {
  public:
    explicit ColmapBytes(std::span<const std::byte> bytes) : bytes_(bytes) {}

    template <typename T>
    T take()
    {
        T value{};
        if (skip(sizeof(T)))
            std::memcpy(&value, bytes_.data() + at_ - sizeof(T), sizeof(T));
        return value;
    }

    bool skip(uint64_t size)
    {
        if (cut_ || size > left())
            return !(cut_ = true);
        at_ += size;
        return true;
    }

    std::string name() // up to a NUL
    {
        std::string text;
        for (char c; (c = take<char>()) != '\0' && text.size() <= kLongestName;)
            text += c;
        return text;
    }

    uint64_t left() const { return bytes_.size() - at_; }
    uint64_t position() const { return at_; }
    bool cut() const { return cut_; }

  private:
    std::span<const std::byte> bytes_;
    size_t at_ = 0;
    bool cut_ = false;
};

// CAMERA_ID u32, MODEL_ID i32, WIDTH u64, HEIGHT u64, PARAMS f64 each
Result<std::map<uint32_t, Intrinsics>> read_binary_cameras(const Path& path)
{
    const std::string name = quote_path(path);
    SR_TRY(const MappedFile file, MappedFile::open(path));
    ColmapBytes bytes(file.bytes());
    std::map<uint32_t, Intrinsics> cameras;
    const auto count = bytes.take<uint64_t>();
    for (uint64_t i = 0; i < count; ++i) {
        const std::string where = fmt::format("{} camera {} at byte {}", name, i, bytes.position());
        const auto id = bytes.take<uint32_t>(), model_id = bytes.take<uint32_t>();
        std::vector<double> values{double(bytes.take<uint64_t>()), double(bytes.take<uint64_t>())};
        if (bytes.cut())
            return fail(ErrorCode::bad_input, "{}: the file ends, expected {} cameras", where, count);
        const ColmapModel* model = colmap_model_of_id(model_id);
        if (!model)
            return fail(ErrorCode::bad_input, "{}: camera model number {} is not supported, expected one of {}", where,
                        model_id, colmap_model_names());
        for (size_t p = 0; p < model->parameters(); ++p)
            values.push_back(bytes.take<double>());
        if (bytes.cut())
            return fail(ErrorCode::bad_input, "{}: the file ends, expected {} cameras", where, count);
        SR_TRY(const Intrinsics intrinsics, colmap_intrinsics(*model, values, where));
        if (!cameras.emplace(id, intrinsics).second)
            return fail(ErrorCode::bad_input, "{}: a second camera {}", where, id);
    }
    if (cameras.empty())
        return fail(ErrorCode::bad_input, "{}: no cameras", name);
    if (bytes.left())
        return fail(ErrorCode::bad_input, "{}: {} bytes follow the last camera", name, bytes.left());
    return cameras;
}

// IMAGE_ID u32, Q w x y z f64, T f64, CAMERA_ID u32, NAME with NUL, a u64 of points, X Y f64 and POINT3D_ID u64 each
Result<ColmapPicture> read_binary_picture(ColmapBytes& bytes, const std::map<uint32_t, Intrinsics>& cameras,
                                          const std::string& where)
{
    bytes.skip(4);
    std::array<double, 4> q{};
    std::array<double, 3> t{};
    for (double& v : q)
        v = bytes.take<double>();
    for (double& v : t)
        v = bytes.take<double>();
    const auto camera_id = bytes.take<uint32_t>();
    std::string picture = bytes.name();
    const auto points = bytes.take<uint64_t>();
    if (picture.size() > kLongestName)
        return fail(ErrorCode::bad_input, "{}: a name of more than {} bytes", where, kLongestName);
    if (bytes.cut() || points > bytes.left() / kPointBytes)
        return fail(ErrorCode::bad_input, "{}: the file ends within a picture of {} points", where, points);
    bytes.skip(points * kPointBytes);
    const auto camera = cameras.find(camera_id);
    if (camera == cameras.end())
        return fail(ErrorCode::bad_input, "{}: no camera {} in cameras.bin", where, camera_id);
    return colmap_picture(q, t, camera->second, std::move(picture), where);
}

} // namespace

Result<std::vector<ColmapPicture>> read_colmap_binary(const Path& folder)
{
    SR_TRY(const auto cameras, read_binary_cameras(folder / "cameras.bin"));
    const Path path = folder / "images.bin";
    const std::string name = quote_path(path);
    SR_TRY(const MappedFile file, MappedFile::open(path));
    ColmapBytes bytes(file.bytes());
    const auto count = bytes.take<uint64_t>();
    std::vector<ColmapPicture> pictures;
    for (uint64_t i = 0; i < count; ++i) {
        SR_TRY(ColmapPicture picture,
               read_binary_picture(bytes, cameras, fmt::format("{} image {} at byte {}", name, i, bytes.position())));
        pictures.push_back(std::move(picture));
    }
    if (pictures.empty())
        return fail(ErrorCode::bad_input, "{}: a trajectory without poses, no images", name);
    if (bytes.left())
        return fail(ErrorCode::bad_input, "{}: {} bytes follow the last image", name, bytes.left());
    return pictures;
}

} // namespace semrover
