// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/scene_objects.h"
#include "engine/mesh/mesh.h"
#include "tools/streets/pattern.h"
#include "tools/streets/vector3.h"

#include <map>
#include <tuple>
#include <vector>

namespace semrover {

using Color = std::array<double, 3>; // sRGB, 0..1

// what a face is made of and what it belongs to
struct Finish {
    uint32_t material = 0;
    uint8_t label = 0;
};

// where on a picture: u to the right, v up, in pictures or in metres as the function says
struct Span {
    double u0 = 0, v0 = 0, u1 = 1, v1 = 1;
};

// Collects faces with materials, labels and texture coordinates. Corners go counter-clockwise seen from outside. Faces
// that share vertices (tubes, lofts, blobs) are smooth, all others flat. A pattern's picture repeats every so many
// metres (pattern.h). Faces without area are left out.
class MeshBuilder {
  public:
    // the tint multiplies the pattern's colours, which are made for a tint of white unless pattern.h says else
    Finish finish(Pattern pattern, uint8_t label, const Color& tint = {1, 1, 1});

    // a lower left, b lower right, c upper right, d upper left; texture in metres from the lower left corner, moved by
    // (u, v)
    void quad(Finish f, const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d, double u = 0,
              double v = 0);
    // likewise; the corners take this part of the picture (0..1)
    void picture(Finish f, const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d,
                 const Span& part = {});
    void pictured(Finish f, const std::array<Vector3, 3>& corners, const std::array<std::array<double, 2>, 3>& uv);
    void triangle(Finish f, const Vector3& a, const Vector3& b, const Vector3& c);
    void polygon(Finish f, const std::vector<Vector3>& corners); // convex, flat, texture along the ground

    // from low to high in a frame; sides: bits of kLeft .. kBottom
    enum Side : uint32_t { kFront = 1, kBack = 2, kLeft = 4, kRight = 8, kTop = 16, kBottom = 32 };
    static constexpr uint32_t kStanding = 31, kAllSides = 63;
    void box(Finish f, const Frame& frame, const Vector3& low, const Vector3& high, uint32_t sides = kStanding);

    // a round bar from a to b; caps: 1 at a, 2 at b
    void tube(Finish f, const Vector3& a, double radius_a, const Vector3& b, double radius_b, int corners = 8,
              int caps = 2);
    // rings of equally many points, counter-clockwise about the direction in which they follow each other
    void loft(Finish f, const std::vector<std::vector<Vector3>>& rings, bool closed = true);
    void disc(Finish f, const Vector3& center, const Vector3& normal, double radius, int corners = 12,
              bool picture = false);
    // an ellipsoid in a frame
    void blob(Finish f, const Frame& frame, const Vector3& radii, int rings = 6, int corners = 8);
    // a ring of round section about an axis
    void torus(Finish f, const Vector3& center, const Vector3& axis, double radius, double thickness, int corners = 14,
               int section = 5);

    // Adds an object: the upright box, along the frame's x, of the faces from number `first` on that have this label.
    // Nothing where there are none. Its id is its number. Those faces are its own, but for those that were another's.
    void note_object(uint8_t label, const Frame& frame, size_t first);
    std::vector<SceneObject>& objects() { return objects_; }

    size_t faces() const { return mesh_.faces.size(); }
    // of each face the id of its object + 1, 0: none
    std::vector<uint32_t> owners() const;
    // smoothness of materials, 0..1 (what they mirror of the sky at right angles), by number
    const std::vector<float>& gloss() const { return gloss_; }
    Mesh take() &&;

  private:
    uint32_t vertex(const Vector3& p);
    void face(Finish f, std::array<uint32_t, 3> corners, const std::array<std::array<double, 2>, 3>& uv);
    uint32_t texture_of(Pattern pattern);

    Mesh mesh_;
    std::vector<SceneObject> objects_;
    std::vector<uint32_t> owners_; // of faces, up to the last that has one
    std::vector<float> gloss_;
    std::vector<double> size_; // metres a picture, by material
    std::map<Pattern, uint32_t> textures_;
    std::map<std::tuple<Pattern, std::array<int, 3>>, uint32_t> materials_;
};

// What is drawn with a label while this lives is an object whose front looks along the frame's x.
class ObjectNote {
  public:
    ObjectNote(MeshBuilder& mesh, uint8_t label, const Frame& frame)
        : mesh_(mesh), label_(label), frame_(frame), first_(mesh.faces())
    {
    }
    ~ObjectNote() { mesh_.note_object(label_, frame_, first_); }
    ObjectNote(const ObjectNote&) = delete;
    ObjectNote& operator=(const ObjectNote&) = delete;

  private:
    MeshBuilder& mesh_;
    uint8_t label_;
    Frame frame_;
    size_t first_;
};

} // namespace semrover
