// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/asset_folder.h"
#include "runtime/base/json.h"

#include <optional>
#include <span>

namespace semrover {

// elements of a buffer, all within it
struct GltfAccessor {
    const std::byte* data = nullptr;
    size_t count = 0, stride = 0; // elements, bytes
    int component = 0;            // 5120 i8, 5121 u8, 5122 i16, 5123 u16, 5125 u32, 5126 f32
    uint32_t components = 0;      // of an element, 16 of a MAT4
    bool normalized = false;

    double number(size_t element, uint32_t c) const;
    uint32_t index(size_t element) const; // of unsigned scalars
};

// The container of a glTF 2.0 file, binary or with its buffers beside it. Every reference is checked before it is
// followed. Source: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
class GltfFile {
  public:
    static Result<GltfFile> open(const Path& path, MissingTextures missing_textures = MissingTextures::refuse);

    const Json& json() const { return json_; }
    const std::string& where() const { return where_; }

    // entry `index` of a top-level array, an object
    Result<const Json*> entry(const char* array, int64_t index) const;
    // of its entries; 0 when it is absent, bad_input for what is no array
    Result<size_t> count(const char* array) const;

    // a member of an object that is a whole number, none when it is absent
    Result<std::optional<int64_t>> integer(const Json& object, const char* key) const;

    // `count` numbers of an object, none when they are absent
    Result<std::vector<double>> numbers(const Json& object, const char* key, size_t count,
                                        std::string_view where) const;

    // sparse ones are refused, and those without a buffer view (Draco has them)
    Result<GltfAccessor> accessor(int64_t index) const;
    Result<std::span<const std::byte>> view(int64_t index) const;
    // the file of an image, the same bytes at the same place for all that name the same
    Result<std::span<const std::byte>> image_file(int64_t index);
    // of the file and those that it names, each counted once
    uint64_t bytes() const;
    AssetFolder& folder() { return folder_; }

  private:
    GltfFile(const Path& path, MissingTextures missing_textures);
    Status split_binary(std::string_view& text);
    Status check_version() const;
    Status load_buffers();
    Result<std::span<const std::byte>> load_uri(const std::string& uri, std::string_view where);

    std::string where_;
    AssetFolder folder_;
    MappedFile file_;
    std::span<const std::byte> binary_; // of a GLB
    Json json_;
    std::map<Path, MappedFile> named_;              // by where links lead: buffers and images may share a file
    std::vector<std::vector<std::byte>> data_uris_; // decoded
    std::vector<std::span<const std::byte>> buffers_;
};

} // namespace semrover
