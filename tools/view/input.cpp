// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

#include "tools/view/viewer.h"

#include <cmath>
#include <GLFW/glfw3.h>
#include <imgui.h>

namespace semrover::view {

namespace {

constexpr float kClick = 4;     // pixels: what the mouse may move during a click
constexpr double kTurn = 0.005; // radians a pixel
constexpr double kZoom = 0.9;   // a notch of the wheel
constexpr ImGuiMouseButton kLeft = ImGuiMouseButton_Left, kRight = ImGuiMouseButton_Right;

bool dragged(ImGuiMouseButton button)
{
    return ImGui::IsMouseDragging(button, kClick);
}

void drag(Viewer& viewer)
{
    const ImVec2 moved = ImGui::GetIO().MouseDelta;
    const bool orbits = dragged(kLeft) == viewer.orbiting;
    if (orbits)
        viewer.camera.orbit(-moved.x * kTurn, -moved.y * kTurn);
    else
        viewer.camera.turn(moved.x * kTurn, moved.y * kTurn);
}

void take_mouse(Viewer& viewer)
{
    const ImGuiIO& io = ImGui::GetIO();
    if (dragged(kLeft) || dragged(kRight))
        drag(viewer);
    if (io.MouseWheel != 0)
        viewer.camera.zoom(std::pow(kZoom, io.MouseWheel));
    const ImVec2 from = io.MouseClickedPos[kLeft], to = io.MousePos;
    if (!ImGui::IsMouseReleased(kLeft) || std::hypot(to.x - from.x, to.y - from.y) > kClick)
        return;
    const auto [width, height] = viewer.size(); // the picture may be stretched to the window
    const Status clicked =
        viewer.click(io.MousePos.x / io.DisplaySize.x * width, io.MousePos.y / io.DisplaySize.y * height);
    viewer.note(clicked);
    if (clicked && io.KeyCtrl)
        viewer.note(viewer.paint());
}

double held(int key)
{
    return ImGui::IsKeyDown(key) ? 1 : 0;
}

void take_keys(Viewer& viewer)
{
    const double way = viewer.speed * viewer.frame_seconds() * (ImGui::GetIO().KeyShift ? 4 : 1);
    const double ahead = held(GLFW_KEY_W) - held(GLFW_KEY_S) + held(GLFW_KEY_UP) - held(GLFW_KEY_DOWN);
    const double right = held(GLFW_KEY_D) - held(GLFW_KEY_A);
    const double up = held(GLFW_KEY_E) - held(GLFW_KEY_Q);
    viewer.camera.move(way * ahead, way * right, way * up);
    viewer.camera.turn(viewer.frame_seconds() * (held(GLFW_KEY_LEFT) - held(GLFW_KEY_RIGHT)), 0);
    for (int n = 0; n < int(kShownNames.size()); ++n)
        if (ImGui::IsKeyPressed(GLFW_KEY_1 + n, false))
            viewer.note(viewer.show(Shown(n)));
    if (ImGui::IsKeyPressed(GLFW_KEY_TAB, false))
        viewer.panels = !viewer.panels;
    if (ImGui::IsKeyPressed(GLFW_KEY_R, false))
        viewer.recorder.on = !viewer.recorder.on;
    if (ImGui::IsKeyPressed(GLFW_KEY_P, false))
        viewer.note(viewer.paint());
    if (ImGui::IsKeyPressed(GLFW_KEY_Z, false) && ImGui::GetIO().KeyCtrl)
        viewer.note(viewer.undo());
    if (ImGui::IsKeyPressed(GLFW_KEY_F, false))
        viewer.note(viewer.refine());
    if (ImGui::IsKeyPressed(GLFW_KEY_ESCAPE, false))
        viewer.quit();
}

} // namespace

void take_input(Viewer& viewer)
{
    const ImGuiIO& io = ImGui::GetIO();
    if (!io.WantCaptureMouse)
        take_mouse(viewer);
    if (!io.WantCaptureKeyboard)
        take_keys(viewer);
}

} // namespace semrover::view
