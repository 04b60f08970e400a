// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

#include "runtime/base/bytes_text.h"
#include "tools/view/viewer.h"

#include <cmath>
#include <imgui.h>
#include <imgui_stdlib.h>

namespace semrover::view {

namespace {

constexpr double kDegrees = 57.29577951308232;
constexpr ImGuiTreeNodeFlags kOpen = ImGuiTreeNodeFlags_DefaultOpen;

// ImGui's own formats are not checked
template <typename... Args>
void line(fmt::format_string<Args...> format, Args&&... args)
{
    ImGui::TextUnformatted(fmt::format(format, std::forward<Args>(args)...).c_str());
}

const char* name_of(uint32_t label)
{
    const char* name = sr_class_name(label);
    return name ? name : "none";
}

ImVec4 color_of(uint32_t label)
{
    uint8_t rgb[3] = {};
    sr_class_color(label, rgb);
    return {float(rgb[0]) / 255, float(rgb[1]) / 255, float(rgb[2]) / 255, 1};
}

void figures_panel(const Figures& f)
{
    if (!ImGui::CollapsingHeader("figures", kOpen))
        return;
    line("frame {:6.1f} ms   step {:6.1f}   draw {:6.1f}", f.frame.mean(), f.step.mean(), f.draw.mean());
    line("tiles {} of {}{}", f.world.finished, f.world.wanted, f.world.full ? ", a budget is full" : "");
    line("      {} in memory, {} generated, {} loaded", f.world.in_memory, f.world.generated, f.world.loaded);
    line("splats {}", f.world.splats);
    line("device {}, at most {}", bytes_text(f.memory.used_bytes), bytes_text(f.memory.peak_bytes));
    line("host   {} of tiles", bytes_text(f.world.host_bytes));
    ImGui::ProgressBar(f.world.wanted ? float(f.world.finished) / float(f.world.wanted) : 0, {-1, 0},
                       f.finished ? "finished" : "generating");
}

void view_panel(Viewer& viewer)
{
    if (!ImGui::CollapsingHeader("view", kOpen))
        return;
    int shown = int(viewer.shown());
    ImGui::SetNextItemWidth(110);
    if (ImGui::Combo("picture", &shown, kShownNames.data(), int(kShownNames.size())))
        viewer.note(viewer.show(Shown(shown)));
    ImGui::SameLine();
    ImGui::Checkbox("orbit", &viewer.orbiting);
    const Camera& c = viewer.camera;
    line("at {:.2f}, {:.2f}, {:.2f} m", c.position[0], c.position[1], c.position[2]);
    line("yaw {:.1f}, pitch {:.1f} degrees", c.yaw * kDegrees, c.pitch * kDegrees);
    auto fov = float(c.fov * kDegrees), speed = float(viewer.speed), radius = float(viewer.street().radius),
         budget = float(viewer.budget_ms);
    if (ImGui::SliderFloat("view angle", &fov, 20, 120, "%.0f deg"))
        viewer.camera.fov = fov / kDegrees;
    if (ImGui::SliderFloat("speed", &speed, 0.5f, 50, "%.1f m/s", ImGuiSliderFlags_Logarithmic))
        viewer.speed = speed;
    if (ImGui::SliderFloat("radius", &radius, 1, 200, "%.0f m", ImGuiSliderFlags_Logarithmic))
        viewer.street().radius = radius;
    if (ImGui::SliderFloat("budget", &budget, 1, 200, "%.0f ms", ImGuiSliderFlags_Logarithmic))
        viewer.budget_ms = budget;
}

void points_table(const PickedCell& cell)
{
    if (!ImGui::TreeNode("points", "%d points", int(cell.points.size())))
        return;
    for (const auto& p : cell.points) {
        ImGui::TextColored({p[3], p[4], p[5], 1}, "#");
        ImGui::SameLine();
        line("{:8.3f} {:8.3f} {:8.3f}", p[0], p[1], p[2]);
    }
    ImGui::TreePop();
}

void cell_panel(const Viewer& viewer)
{
    if (!ImGui::CollapsingHeader("cell", kOpen))
        return;
    if (!viewer.picked()) {
        ImGui::TextDisabled("click one");
        return;
    }
    const PickedCell& cell = *viewer.picked();
    line("cell {}, {}, {}   tile {}, {}", cell.cell.i, cell.cell.j, cell.cell.k, cell.tile[0], cell.tile[1]);
    ImGui::ColorButton("class", color_of(cell.cell.label), ImGuiColorEditFlags_NoTooltip, {14, 14});
    ImGui::SameLine();
    line("{} {}", cell.cell.label, name_of(cell.cell.label));
    ImGui::ColorButton("mean", {cell.color[0], cell.color[1], cell.color[2], 1}, ImGuiColorEditFlags_NoTooltip,
                       {14, 14});
    ImGui::SameLine();
    ImGui::TextUnformatted("mean of its points");
    points_table(cell);
}

void label_choice(Brush& brush)
{
    if (!ImGui::BeginCombo("label", name_of(brush.label)))
        return;
    for (uint32_t label = 0; label <= SR_CLASSES; ++label) {
        const uint32_t value = label < SR_CLASSES ? label : SR_NO_CELL; // the last takes cells away
        ImGui::PushStyleColor(ImGuiCol_Text, value == SR_NO_CELL ? ImVec4(1, 1, 1, 1) : color_of(value));
        ImGui::TextUnformatted("#");
        ImGui::PopStyleColor();
        ImGui::SameLine();
        if (ImGui::Selectable(name_of(value), brush.label == value))
            brush.label = value;
    }
    ImGui::EndCombo();
}

void brush_panel(Viewer& viewer)
{
    if (!ImGui::CollapsingHeader("paint", kOpen))
        return;
    ImGui::SetNextItemWidth(140);
    label_choice(viewer.brush);
    ImGui::SetNextItemWidth(140);
    ImGui::SliderInt("reach", &viewer.brush.reach, 0, 8, "%d cells");
    if (ImGui::Button("paint"))
        viewer.note(viewer.paint());
    ImGui::SameLine();
    if (ImGui::Button("undo"))
        viewer.note(viewer.undo());
    static std::string file = "painted.sgrid";
    ImGui::SetNextItemWidth(140);
    ImGui::InputText("##grid", &file);
    ImGui::SameLine();
    if (ImGui::Button("save grid"))
        viewer.note(viewer.save_grid(file));
}

void path_panel(Viewer& viewer)
{
    if (!ImGui::CollapsingHeader("path", kOpen))
        return;
    ImGui::Checkbox("record", &viewer.recorder.on);
    ImGui::SameLine();
    line("{} cameras", viewer.recorder.size());
    ImGui::SameLine();
    if (ImGui::Button("play"))
        viewer.play();
    ImGui::SameLine();
    if (ImGui::Button("clear"))
        viewer.recorder.clear();
    static std::string file = "path.tum";
    ImGui::SetNextItemWidth(140);
    ImGui::InputText("##path", &file);
    ImGui::SameLine();
    if (ImGui::Button("save path"))
        viewer.note(viewer.save_path(file));
}

void refine_panel(Viewer& viewer)
{
    if (!ImGui::CollapsingHeader("refine", kOpen))
        return;
    if (ImGui::Button("refine this view"))
        viewer.note(viewer.refine());
    ImGui::SameLine();
    if (viewer.refiner().busy())
        line("{} steps, {:.0f} ms", viewer.refiner().steps(), viewer.refiner().step_ms());
    else if (viewer.shown() == Shown::refined)
        ImGui::TextUnformatted("shown");
}

} // namespace

void draw_panels(Viewer& viewer)
{
    ImGui::SetNextWindowPos({10, 10}, ImGuiCond_FirstUseEver);
    ImGui::SetNextWindowBgAlpha(0.8f);
    ImGui::Begin("semrover", nullptr, ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoCollapse);
    ImGui::PushItemWidth(160);
    figures_panel(viewer.figures());
    view_panel(viewer);
    cell_panel(viewer);
    brush_panel(viewer);
    path_panel(viewer);
    refine_panel(viewer);
    if (!viewer.notice().empty()) {
        ImGui::Separator();
        ImGui::PushTextWrapPos(330);
        ImGui::TextUnformatted(viewer.notice().c_str());
        ImGui::PopTextWrapPos();
    }
    ImGui::PopItemWidth();
    ImGui::End();
}

} // namespace semrover::view
