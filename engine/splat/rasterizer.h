// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera_view.h"
#include "engine/splat/splat_scene.h"
#include "kernels/picture.h"
#include "runtime/device/executable.h"

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace semrover {

// OpenCV: x right, y down, z forward; the centre of pixel (x, y) is at (x + 0.5, y + 0.5)
struct SplatCamera {
    float fx = 0, fy = 0, cx = 0, cy = 0;    // pixels
    std::array<float, 12> world_to_camera{}; // [3, 4], row-major, metres
    // of a lens that is no pinhole: engine/camera/lens.h
    std::array<float, 12> distortion{};
    float limit = 0, reach = 0;
    bool radial_depth = false; // depth is the distance from the camera, not along z
    // of one that moves while it is read out: CameraMotion (engine/camera/camera_view.h), and lines as it has them
    std::array<float, 3> turn{}, shift{};
    std::array<float, 2> across{};
    float first = 0;
};
SplatCamera splat_camera(const Intrinsics& intrinsics, const Pose& pose);
// moving: for a rasterizer of cameras that move while they are read out, or look at what moves meanwhile
SplatCamera splat_camera(const CameraFrame& frame, bool moving);
SplatLens lens_of(CameraModel model);
// pinholes are drawn there as opencv lenses without distortion
CameraModel drawn_model(CameraModel model, bool moving);
// as kernels take it: splat_camera_floats() numbers
void write_row(const SplatCamera& camera, std::span<float> row);

// what one camera sees; [height, width] row-major. w is the weight of a splat in a pixel, front to back.
struct SplatImage {
    uint32_t width = 0, height = 0;
    std::vector<float> color = {};     // [.., 3] sum of w rgb, nothing behind it
    std::vector<float> alpha = {};     // sum of w
    std::vector<float> normal = {};    // [.., 3] sum of w normal; camera frame, towards the camera
    std::vector<float> depth_sum = {}; // sum of w depth, metres along the axis (or as SplatCamera::radial_depth says)
    std::vector<float> depth_expected = {}; // depth_sum / alpha, 0 where alpha is
    std::vector<float> depth_median = {}; // of the splat with which alpha passes one half, else of the last; 0 for none
    std::vector<uint32_t> label = {}, cell = {}; // of the splat with the largest w; kNothing for none
    std::vector<uint32_t> owner = {};            // of that splat, as SplatImages has it; where formats ask for it
    std::vector<uint8_t> visible = {};           // 1 where alpha reaches the threshold

    static constexpr uint32_t kNothing = 0xffffffffu;
};

struct RasterizerOptions {
    float visible_alpha = 0.5f;
    float near = 0.2f; // metres
    float alpha_min = 1.f / 255, alpha_max = 0.99f;
    float transmittance_min = 1e-4f;
    float screen_variance = 0.5f;             // pixels^2; 0: no screen filter
    float cutoff = 0;                         // sigmas; 0: as far as alpha_min
    uint32_t tile = 16;                       // pixels, a multiple of 16
    uint32_t max_pairs = 0;                   // to begin with; 0: from the number of splats
    std::optional<uint32_t> rows = {};        // the scene's first ones at least; none: all of it
    CameraModel model = CameraModel::pinhole; // of all cameras
    bool moving = false;                      // cameras or movers move during a readout; no pinholes
    // of a lidar's sweep, one a row of the images (shaders/splat/splat.h): cameras are parts of sweeps
    std::vector<std::array<float, 4>> sweep_rows = {};
    // keeps pixels as files have them, over this background, in place of images: draw() and pixels(), not render()
    std::optional<std::array<uint8_t, 3>> pixels_over = {};
    float depth_units = 1000;   // of these, to a metre; 0: fp32 metres
    bool instances = false;     // pixels have the numbers of things, too
    uint32_t movers = 0;        // room for things that move,
    uint32_t mover_numbers = 0; // with numbers below this
    bool depth_tested = false;  // against z_buffer(), of pinholes
    // of color, surface, depth, ids and owners: how images() has them, and whether it has. render() needs the first
    // four whole. Owners that are whole are as SplatImages has them; in another format, numbers of things
    std::array<PictureFormat, 5> formats = {{{}, {}, {}, {}, {Texels::none}}};

    bool operator==(const RasterizerOptions&) const = default;
};

// what one camera sees, on the device: as SplatImages (kernels/splat.h) has it, a row a pixel, or in words, where
// another format was asked for, or nothing; or as files have it (PixelWords, kernels/picture.h)
struct SplatSlots {
    DeviceTensor color, surface, depth, ids, owners;
    std::array<DeviceTensor*, 5> all() { return {&color, &surface, &depth, &ids, &owners}; }
};
struct SplatPixelSlots {
    DeviceTensor seen, depths, normals, instances; // the last where it is asked for
};

// Things that move at the moment of a draw
struct SplatMovers {
    uint32_t count = 0;
    std::vector<uint32_t> rows = {};               // by the number of a thing, as SplatOptions::mover_rows
    std::vector<std::array<float, 12>> views = {}; // [cameras, movers], as SplatOptions::movers; moving: two of each
};
// the two of a thing with poses at the start and at the end of a readout; `from_splats` to its own frame
std::array<std::array<float, 12>, 2> moving_views(const CameraMotion& camera, const Rigid& from, const Rigid& to,
                                                  const Rigid& from_splats);

// Draws a scene from up to max_cameras cameras in one submit; more are drawn in turns. The graph is built once and
// replayed; when a frame has more splats or tiles than it has room for, it is built again with more, and the frame
// repeated. Time and memory go by the rows that it looks at, not by the scene's size. The scene must outlive it.
class Rasterizer {
  public:
    // errors: usage for sizes that are not 1..65535; out_of_memory
    static Result<std::unique_ptr<Rasterizer>> create(Device& device, const SplatScene& scene, uint32_t width,
                                                      uint32_t height, uint32_t max_cameras,
                                                      const RasterizerOptions& options = {});

    // errors: bad_input for a camera that is not finite or without focal length; out_of_memory, device_lost
    Result<std::vector<SplatImage>> render(std::span<const SplatCamera> cameras, const SplatMovers& movers = {});
    // The same into `images`, whose memory is used again where it fits. For frame after frame: to allocate new memory
    // takes the host longer than to read the images back.
    Status render(std::span<const SplatCamera> cameras, std::vector<SplatImage>& images,
                  const SplatMovers& movers = {});

    // the same on the device: draws as many of the first cameras as it has room for, and says how many; what they see
    // stays until the next call
    Result<uint32_t> draw(std::span<const SplatCamera> cameras, const SplatMovers& movers = {});
    SplatSlots images(uint32_t camera) const;
    SplatPixelSlots pixels(uint32_t camera) const;

    // With depth_tested: [height * width] of the first camera, and [1, 2] fp32, scale and offset: splats farther than
    // scale / (z - offset) metres along z are not drawn. To be filled before each draw
    const DeviceTensor& z_buffer() const { return z_buffer_; }
    const DeviceTensor& z_scale() const { return z_scale_; }
    // [1, 2] fp32, where a format is scaled, likewise
    const DeviceTensor& format_scale() const { return format_scale_; }

    // The same by an application's hand: records the drawing into a command buffer, to be executed any number of times,
    // one after the other, on the device's queue family. camera: copied. What is recorded is good as long as the
    // rasterizer. z_scale, format_scale: where there are such slots; z_buffer() is filled by what was recorded before.
    // Errors: bad_input as render()'s
    Status record(VkCommandBuffer commands, const SplatCamera& camera, std::array<float, 2> z_scale = {},
                  std::array<float, 2> format_scale = {}, const SplatMovers& movers = {});
    // The most pairs that one of the last kRecordings had, of those that have been executed: where they are more than
    // max_pairs(), it lacks the farthest splats. Does not wait
    uint32_t recorded_pairs() const;
    static constexpr uint32_t kRecordings = 16;

    const Executable& executable() const { return *executable_; }
    bool is_built() const { return executable_ != nullptr; } // false: the last time there was no memory for it
    // device memory for what it has room for now, beside the scene's
    uint64_t planned_bytes() const
    {
        return state_.planned_bytes(device_.limits()) + executable_->plan().arena_bytes();
    }
    uint32_t rows() const { return rows_; } // of the scene that it looks at
    uint32_t max_pairs() const { return max_pairs_; }
    uint32_t rebuilds() const { return rebuilds_; } // how often there was not enough room

  private:
    struct MoverTables { // as the device has them
        std::vector<uint32_t> rows;
        std::vector<std::array<float, 12>> views;
    };
    Rasterizer(Device& device, const SplatScene& scene) : device_(device), scene_(scene) {}
    uint32_t views_of_movers() const { return options_.movers * (options_.moving ? 2 : 1); } // a camera
    SplatLens lens() const;
    Status build();
    void declare_images(uint32_t pixels);
    void keep_images(Graph& g, const SplatImages& images);
    void keep_pixels(Graph& g, const SplatImages& images);
    Status make_room(uint32_t visible, uint32_t pairs);
    Result<uint32_t> draw_some(std::span<const SplatCamera> cameras, const SplatMovers& movers, size_t first);
    Status draw_together(std::span<const SplatCamera> cameras, const SplatMovers& movers, size_t first);
    MoverTables tables_of(const SplatMovers& movers, size_t first, size_t cameras) const;
    Status read_images(std::span<SplatImage> images);

    Device& device_;
    const SplatScene& scene_;
    RasterizerOptions options_;
    uint32_t width_ = 0, height_ = 0, cameras_ = 0, rows_ = 0;
    uint32_t max_visible_ = 0, max_pairs_ = 0, rebuilds_ = 0;
    TensorPool state_;
    DeviceTensor camera_table_, visible_, pairs_, z_buffer_, z_scale_, format_scale_, movers_, mover_rows_, sweep_rows_;
    std::unique_ptr<Buffer> recorded_; // [kRecordings] u32: pairs of what was recorded, where the host sees them
    uint32_t recording_ = 0;
    SplatSlots images_;      // of all cameras, or
    SplatPixelSlots pixels_; // likewise
    std::unique_ptr<Executable> executable_;
};

} // namespace semrover
