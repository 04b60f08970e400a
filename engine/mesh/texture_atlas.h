// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh.h"
#include "kernels/mesh.h"
#include "runtime/device/device.h"
#include "runtime/device/tensor_pool.h"

namespace semrover {

// A mesh's materials and textures on a device. Texels of all textures have one row of addresses, cut into pages that
// the device can bind; label textures hold labels, with `default_label` where a pixel says none. Alpha is one binding.
class TextureAtlas {
  public:
    // errors: bad_input for more than 2^32 texels, out_of_memory (also for more alpha than the device binds, a byte a
    // texel), device_lost
    static Result<TextureAtlas> create(Device& device, const Mesh& mesh, uint8_t default_label);

    Tensor materials(Graph& g) const;
    Tensor textures(Graph& g) const;
    Tensor alphas(Graph& g) const;
    bool masked() const { return masked_; }
    bool has_labels() const { return has_labels_; }

    // y = texels where `addresses` points to one; the rest of y stays
    void gather(Graph& g, Tensor addresses, Tensor y, Tensor count = {}) const;

  private:
    struct Page {
        TensorPool state;
        DeviceTensor texels;
        uint32_t first;
    };
    struct Rows { // of textures
        std::vector<std::array<uint32_t, 4>> rows;
        std::vector<int32_t> labels, alphas; // textures that hold them, each once; their rows come behind all others
        std::vector<uint32_t> alpha_words;
    };
    Status add_alphas(Device& device, const Mesh& mesh, Rows& rows);
    Status upload_tables(Device& device, const Mesh& mesh, const Rows& rows);
    Status upload_texels(Device& device, const Mesh& mesh, const std::vector<int32_t>& label_sources,
                         uint8_t default_label, uint64_t texels);

    TensorPool tables_;
    DeviceTensor materials_, textures_, alphas_;
    std::vector<Page> pages_;
    bool has_labels_ = false, masked_ = false;
};

// The label of a pixel of a label texture: by its colour in the palette, else by its number as gray; kNoLabel if
// neither.
uint8_t label_of_pixel(const uint8_t* rgb);
uint8_t label_of_number(uint16_t number); // likewise

} // namespace semrover
