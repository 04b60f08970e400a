// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/view/camera.h"
#include "tools/view/figures.h"
#include "tools/view/refiner.h"
#include "tools/view/street.h"
#include "tools/view/window.h"

namespace semrover::view {

class Script;

struct ViewRequest {
    StreetRequest street;
    RefinerRequest refiner;
    std::string device;     // name or index; empty: the best
    uint64_t max_bytes = 0; // of the library's device memory; 0: no budget
    uint32_t width = 1280, height = 720;
    double budget_ms = 8; // of a frame, for the library
    bool window = true, panels = true, replace = false;
    Shown shown = Shown::color;
    double fov = 1.27;                // radians, across
    std::optional<Vector> position;   // where the camera starts; none: over a road
    std::optional<double> yaw, pitch; // radians
};

// The viewer: a street, a camera in it, and what mouse, panels and scripts do with them. Its actions are what all three
// share. An error of an action leaves the viewer as it was.
class Viewer {
  public:
    static Result<std::unique_ptr<Viewer>> open(const ViewRequest& request);
    ~Viewer();

    // Frames until the window is closed, the script is through and says so, or an error. interrupted: Ctrl-C
    Status run(Script& script);

    Camera camera;
    Recorder recorder;
    Brush brush;
    bool orbiting = false; // what a drag of the mouse does
    bool panels = true;
    double speed = 4; // metres a second of flight
    double budget_ms = 8;

    Shown shown() const { return shown_; }
    Status show(Shown shown);         // usage: no refined frame yet
    Status click(double x, double y); // a pixel of the last picture; picked() is none where nothing is
    Status paint();                   // around the picked voxel. usage: none is picked
    Status undo();
    Status refine(); // what the camera sees; shown when it is finished, until the camera moves
    Status save_path(const Path& path) const;
    Status save_grid(const Path& path) const;
    Status save_picture(const Path& path); // of the frame that is drawn next
    void play();                           // flies along what was recorded
    void quit() { quitting_ = true; }

    const std::optional<PickedCell>& picked() const { return picked_; }
    const Figures& figures() const { return figures_; }
    const Refiner& refiner() const { return *refiner_; }
    Street& street() { return *street_; }
    std::array<uint32_t, 2> size() const { return {picture_->width(), picture_->height()}; }
    bool settled() const { return figures_.finished && !refiner_->busy() && !playing_; }
    const std::string& notice() const { return notice_; }
    void note(const Status& status); // keeps an error's line for the panels
    void note(std::string line) { notice_ = std::move(line); }
    double frame_seconds() const { return frame_seconds_; } // of flight

  private:
    explicit Viewer(const ViewRequest& request) : request_(request) {}
    Status start();
    Status check_replace(const Path& path) const;
    Status frame(Script& script);
    Status fit_window();
    Status work();
    Status draw();
    Status draw_alone();
    Status draw_once(const sr_draw_desc& what, const Look& look, ImDrawData* panels);
    Status write_wanted_picture();
    Status count_frame(double ms);
    Status grow(uint64_t budget_us);
    void follow_recording();
    Look look() const;

    ViewRequest request_;
    std::unique_ptr<Window> window_;
    std::unique_ptr<Gpu> gpu_;
    std::unique_ptr<Shading> shading_;
    std::unique_ptr<Overlay> overlay_;
    std::unique_ptr<Street> street_;
    std::unique_ptr<Refiner> refiner_;
    std::unique_ptr<Picture> picture_;

    Shown shown_ = Shown::color, before_refined_ = Shown::color;
    Camera drawn_camera_, refined_camera_;
    bool refined_there_ = false, quitting_ = false;
    bool repick_ = false; // the picked voxel may have another label and other points once all is finished
    std::optional<size_t> playing_;
    std::optional<PickedCell> picked_;
    Path wanted_picture_;
    Figures figures_;
    std::string notice_;
    double seconds_ = 0, frame_seconds_ = 1.0 / 30;
    Stopwatch since_resize_;
    std::array<uint32_t, 2> window_size_{};
};

// what mouse and keys do, where no panel takes them. Between the beginning and the end of the overlay's frame
void take_input(Viewer& viewer);

// The panels over the picture: figures, what is shown, the picked voxel, brush, path, refinement. Between the beginning
// and the end of the overlay's frame
void draw_panels(Viewer& viewer);

} // namespace semrover::view
