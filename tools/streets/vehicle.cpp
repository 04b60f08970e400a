// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street_objects.h"

#include "tools/streets/class_label.h"

#include <algorithm>
#include <span>

namespace semrover {

namespace {

constexpr Color kPaints[] = {{0.86, 0.87, 0.87}, {0.12, 0.12, 0.13}, {0.55, 0.56, 0.57}, {0.36, 0.37, 0.39},
                             {0.7, 0.71, 0.72},  {0.45, 0.12, 0.11}, {0.14, 0.22, 0.38}, {0.25, 0.28, 0.3},
                             {0.9, 0.9, 0.88},   {0.2, 0.3, 0.25},   {0.55, 0.48, 0.38}, {0.2, 0.21, 0.22}};

// what covers a stretch of roof line, and of the flank above the belt
enum class Cover : uint8_t { paint, glass, dark };

// a cut across the car, from the front: place 0..1, height of its top in metres, half width in parts of the whole
struct Cut {
    double at, top, wide;
    Cover over, beside; // up to the next cut
};

struct Body {
    VehicleSize size;
    double belt, roof_width; // height of the window line; width of the roof, in parts
    std::span<const Cut> cuts;
};

using enum Cover;
constexpr Cut kSedan[] = {
    {0, 0.62, 0.8, paint, paint},     {0.02, 0.72, 0.93, paint, paint}, {0.1, 0.79, 1, paint, paint},
    {0.275, 0.95, 1, glass, glass},   {0.42, 1.4, 1, paint, glass},     {0.53, 1.45, 1, paint, dark},
    {0.55, 1.45, 1, paint, glass},    {0.7, 1.4, 1, glass, glass},      {0.84, 1.06, 0.99, paint, paint},
    {0.97, 1.02, 0.94, paint, paint}, {1, 0.72, 0.86, paint, paint}};
constexpr Cut kHatchback[] = {{0, 0.64, 0.8, paint, paint},      {0.02, 0.75, 0.93, paint, paint},
                              {0.1, 0.84, 1, paint, paint},      {0.25, 0.98, 1, glass, glass},
                              {0.41, 1.44, 1, paint, glass},     {0.55, 1.49, 1, paint, dark},
                              {0.575, 1.49, 1, paint, glass},    {0.84, 1.43, 0.98, glass, paint},
                              {0.965, 1.02, 0.95, paint, paint}, {1, 0.74, 0.88, paint, paint}};
constexpr Cut kEstate[] = {
    {0, 0.62, 0.8, paint, paint},    {0.02, 0.73, 0.93, paint, paint}, {0.1, 0.8, 1, paint, paint},
    {0.27, 0.96, 1, glass, glass},   {0.41, 1.42, 1, paint, glass},    {0.53, 1.48, 1, paint, dark},
    {0.55, 1.48, 1, paint, glass},   {0.73, 1.47, 1, paint, dark},     {0.75, 1.46, 1, paint, glass},
    {0.91, 1.4, 0.98, glass, paint}, {0.98, 1.0, 0.95, paint, paint},  {1, 0.72, 0.88, paint, paint}};
constexpr Cut kSuv[] = {
    {0, 0.78, 0.84, paint, paint},   {0.02, 0.9, 0.95, paint, paint},  {0.1, 1.0, 1, paint, paint},
    {0.27, 1.1, 1, glass, glass},    {0.4, 1.62, 1, paint, glass},     {0.53, 1.69, 1, paint, dark},
    {0.555, 1.69, 1, paint, glass},  {0.74, 1.68, 1, paint, dark},     {0.76, 1.67, 1, paint, glass},
    {0.91, 1.6, 0.98, glass, paint}, {0.98, 1.12, 0.96, paint, paint}, {1, 0.8, 0.9, paint, paint}};
constexpr Cut kVan[] = {{0, 0.8, 0.84, paint, paint}, {0.02, 0.95, 0.95, paint, paint},  {0.08, 1.08, 1, paint, paint},
                        {0.16, 1.2, 1, glass, glass}, {0.3, 2.05, 1, paint, glass},      {0.36, 2.18, 1, paint, paint},
                        {0.7, 2.2, 1, paint, paint},  {0.985, 2.16, 0.97, paint, paint}, {1, 0.75, 0.95, paint, paint}};

Body body_of(CarBody b)
{
    switch (b) {
    case CarBody::sedan:
        return {{4.62, 1.81, 1.45}, 0.93, 0.7, kSedan};
    case CarBody::estate:
        return {{4.6, 1.8, 1.48}, 0.93, 0.74, kEstate};
    case CarBody::suv:
        return {{4.55, 1.88, 1.69}, 1.07, 0.76, kSuv};
    case CarBody::van:
        return {{5.2, 1.96, 2.2}, 1.15, 0.86, kVan};
    default:
        return {{4.1, 1.76, 1.49}, 0.95, 0.72, kHatchback};
    }
}

class CarShell {
  public:
    CarShell(MeshBuilder& mesh, const Frame& middle, const Body& body, const Color& color)
        : m_(mesh), f_(middle), b_(body)
    {
        const uint8_t c = label::kCar;
        paint_ = m_.finish(Pattern::car_paint, c, color);
        flank_ = m_.finish(Pattern::car_side, c, color);
        glass_ = m_.finish(Pattern::car_glass, c);
        dark_ = m_.finish(Pattern::rubber, c, {0.9, 0.9, 0.9});
    }

    void add()
    {
        for (size_t i = 0; i + 1 < b_.cuts.size(); ++i)
            segment(b_.cuts[i], b_.cuts[i + 1]);
        rails();
        ends();
        details();
        const double x = b_.size.length / 2 - 0.15, y = b_.size.width * 0.46;
        m_.box(dark_, f_, {-x, -y, 0.16}, {x, y, 0.24}, MeshBuilder::kBottom | MeshBuilder::kStanding);
    }

  private:
    double x_of(const Cut& c) const { return b_.size.length * (0.5 - c.at); }
    double half(const Cut& c) const { return b_.size.width / 2 * c.wide; }
    bool cabin(const Cut& c) const { return c.top > b_.belt + 0.06; }
    double belt(const Cut& c) const { return std::min(c.top, b_.belt); }

    // side: +1 left, -1 right; level: 0 sill, 1 widest, 2 belt, 3 edge of the top, 4 middle of the top
    Vector3 point(const Cut& c, int side, int level) const
    {
        const double w = half(c), x = x_of(c);
        switch (level) {
        case 0:
            return f_.at(x, side * w * 0.95, 0.24);
        case 1:
            return f_.at(x, side * w, std::min(0.58, c.top - 0.05));
        case 2:
            return f_.at(x, side * w * 0.965, belt(c));
        case 3:
            return cabin(c) ? f_.at(x, side * w * b_.roof_width, c.top - 0.05) : point(c, side, 2);
        default:
            return f_.at(x, 0, c.top + (cabin(c) ? 0 : 0.035));
        }
    }
    Finish finish(Cover c) const { return c == Cover::paint ? paint_ : c == Cover::glass ? glass_ : dark_; }

    // corners as seen from outside on the left; mirrored on the right
    void face(Finish f, int side, const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d)
    {
        side > 0 ? m_.quad(f, a, b, c, d) : m_.quad(f, b, a, d, c);
    }

    void segment(const Cut& front, const Cut& rear)
    {
        for (int side : {1, -1}) {
            for (int level : {0, 1}) {
                const Vector3 a = point(front, side, level), b = point(rear, side, level);
                const Vector3 c = point(rear, side, level + 1), d = point(front, side, level + 1);
                const double v0 = level == 0 ? 0 : 0.5, v1 = level == 0 ? 0.5 : 1;
                // seen from the left the front is to the left as well
                if (side > 0)
                    m_.picture(flank_, a, b, c, d, {front.at, v0, rear.at, v1});
                else
                    m_.picture(flank_, b, a, d, c, {rear.at, v0, front.at, v1});
            }
            face(finish(front.beside), side, point(front, side, 2), point(rear, side, 2), point(rear, side, 3),
                 point(front, side, 3));
            face(finish(front.over), side, point(front, side, 3), point(rear, side, 3), point(rear, side, 4),
                 point(front, side, 4));
        }
    }

    // pillars and the edge of the roof
    void rails()
    {
        for (size_t i = 0; i + 1 < b_.cuts.size(); ++i)
            if (cabin(b_.cuts[i]) || cabin(b_.cuts[i + 1]))
                for (int side : {1, -1})
                    m_.tube(paint_, point(b_.cuts[i], side, 3), 0.035, point(b_.cuts[i + 1], side, 3), 0.035, 5, 0);
    }

    void ends()
    {
        for (bool front : {true, false}) {
            const Cut& c = front ? b_.cuts.front() : b_.cuts.back();
            for (int level : {0, 1}) {
                const Vector3 l0 = point(c, 1, level), r0 = point(c, -1, level);
                const Vector3 l1 = point(c, 1, level + 1), r1 = point(c, -1, level + 1);
                front ? m_.quad(level ? paint_ : dark_, r0, l0, l1, r1)
                      : m_.quad(level ? paint_ : dark_, l0, r0, r1, l1);
            }
            const Vector3 l = point(c, 1, 2), r = point(c, -1, 2), top = point(c, 1, 4);
            front ? m_.triangle(paint_, r, l, top) : m_.triangle(paint_, l, r, top);
            lights(front, c);
        }
    }

    // pictures a little in front of the bumper: x sign, from y0 to y1
    void badge(Finish f, bool front, double y0, double y1, double z0, double z1, double out)
    {
        const double x = (front ? 1 : -1) * (b_.size.length / 2 + out), a = front ? y0 : y1, b = front ? y1 : y0;
        m_.picture(f, f_.at(x, a, z0), f_.at(x, b, z0), f_.at(x, b, z1), f_.at(x, a, z1));
    }

    void lights(bool front, const Cut& c)
    {
        const uint8_t car = label::kCar;
        const double w = half(c), top = c.top - 0.02, low = top - (front ? 0.17 : 0.24);
        const Finish lamp = m_.finish(front ? Pattern::headlight : Pattern::taillight, car);
        badge(lamp, front, w * 0.58, w * 0.99, low, top, 0.008);
        badge(lamp, front, -w * 0.99, -w * 0.58, low, top, 0.008);
        if (front)
            badge(m_.finish(Pattern::grille, car), true, -w * 0.52, w * 0.52, low - 0.16, low + 0.12, 0.006);
        const double z = front ? 0.34 : low - 0.02;
        badge(m_.finish(Pattern::plate, car), front, -0.26, 0.26, z - 0.06, z + 0.05, 0.014);
        badge(dark_, front, -w * 0.94, w * 0.94, 0.25, 0.31, 0.012);
    }

    void details()
    {
        const double l = b_.size.length, y = b_.size.width / 2, r = b_.size.height > 1.6 ? 0.35 : 0.315;
        for (int side : {1, -1})
            for (double at : {l * 0.5 - 0.82, -l * 0.5 + 0.8}) {
                Frame axle = f_.moved(at, side * (y + 0.002), r);
                m_.disc(dark_, axle.at(0, side * 0.002, 0.07), axle.y * double(side), r + 0.065, 16);
                if (side < 0)
                    axle = axle.turned(3.14159265358979323846);
                add_wheel(m_, axle.moved(0, 0.012, 0), r, 0.2, label::kCar);
            }
        const double x = l * 0.5 - l * 0.335;
        for (int side : {1, -1}) // mirrors
            m_.blob(paint_, f_.moved(x, side * (y + 0.07), b_.belt + 0.06), {0.07, 0.1, 0.07}, 4, 6);
    }

    MeshBuilder& m_;
    Frame f_;
    const Body& b_;
    Finish paint_, flank_, glass_, dark_;
};

} // namespace

VehicleSize car_size(CarBody body)
{
    return body_of(body).size;
}

void add_wheel(MeshBuilder& m, const Frame& a, double radius, double width, uint8_t l)
{
    const Finish tyre = m.finish(Pattern::rubber, l), rim = m.finish(Pattern::rim, l);
    m.tube(tyre, a.at(0, -width, 0), radius, a.at(0, -0.015, 0), radius, 16, 1);
    m.tube(tyre, a.at(0, -0.015, 0), radius, a.at(0, 0, 0), radius * 0.93, 16, 2);
    m.disc(rim, a.at(0, 0.004, 0), a.y, radius * 0.7, 14, true);
}

void add_car(MeshBuilder& m, const Frame& middle, CarBody kind, KeyedRandom& r)
{
    const Body body = body_of(kind);
    const Color paint = kind == CarBody::van && r.chance(0.6) ? Color{0.86, 0.87, 0.87} : r.pick(kPaints);
    const ObjectNote note(m, label::kCar, middle);
    CarShell(m, middle, body, paint).add();
}

} // namespace semrover
