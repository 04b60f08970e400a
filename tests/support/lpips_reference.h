// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "tests/support/state_dict.h"

#include <algorithm>
#include <set>

// LPIPS 0.1 in double, module by module as torchvision numbers them, with random weights
namespace semrover {

class LpipsReference {
  public:
    StateDict weights;

    // numbers of channels of the usual networks, divided by `divisor`
    LpipsReference(bool vgg, int divisor)
    {
        if (vgg) {
            for (const int outputs : {64, 64, 0, 128, 128, 0, 256, 256, 256, 0, 512, 512, 512, 0, 512, 512, 512})
                outputs ? convolution(outputs / divisor, 3, 1, 1) : pool(2);
            ends_ = {3, 8, 15, 22, 29}; // relu1_2, relu2_2, relu3_3, relu4_3, relu5_3
        } else {
            convolution(64 / divisor, 11, 4, 2);
            pool(3);
            convolution(192 / divisor, 5, 1, 2);
            pool(3);
            for (const int outputs : {384, 256, 256})
                convolution(outputs / divisor, 3, 1, 1);
            ends_ = {1, 4, 7, 9, 11};
        }
        add_weights();
    }

    double operator()(const ImageRgb8& a, const ImageRgb8& b) const
    {
        double sum = 0;
        Planes x = scaled(a), y = scaled(b);
        int linear = 0;
        for (int i = 0; i < int(modules_.size()); ++i) {
            x = run(i, x);
            y = run(i, y);
            if (ends_.contains(i))
                sum += layer(x, y, weights.values("lin" + std::to_string(linear++) + ".model.1.weight"));
        }
        return sum;
    }

  private:
    struct Module {
        enum class Kind { convolution, relu, pool } kind;
        int outputs = 0, side = 0, stride = 1, padding = 0;
    };
    struct Planes { // [channels, height, width]
        int channels = 0, height = 0, width = 0;
        std::vector<double> v = std::vector<double>(size_t(channels) * size_t(height) * size_t(width));

        double* row(int c, int y) { return &v[(size_t(c) * size_t(height) + size_t(y)) * size_t(width)]; }
        const double* row(int c, int y) const { return const_cast<Planes*>(this)->row(c, y); }
    };

    void convolution(int outputs, int side, int stride, int padding)
    {
        modules_.push_back({Module::Kind::convolution, outputs, side, stride, padding});
        modules_.push_back({Module::Kind::relu});
    }
    void pool(int side) { modules_.push_back({Module::Kind::pool, 0, side, 2}); }

    void add_weights()
    {
        int channels = 3, linear = 0;
        for (int i = 0; i < int(modules_.size()); ++i) {
            const Module& m = modules_[size_t(i)];
            if (m.kind == Module::Kind::convolution) {
                const auto outputs = uint64_t(m.outputs), inputs = uint64_t(channels), side = uint64_t(m.side);
                const std::string name = "features." + std::to_string(i);
                weights.add(name + ".weight", {outputs, inputs, side, side},
                            std::sqrt(2. / double(inputs * side * side)));
                weights.add(name + ".bias", {outputs}, 0.1);
                channels = m.outputs;
            }
            if (ends_.contains(i))
                weights.add("lin" + std::to_string(linear++) + ".model.1.weight", {1, uint64_t(channels), 1, 1}, 1, 0,
                            true);
        }
    }

    static Planes scaled(const ImageRgb8& image)
    {
        constexpr double kShift[] = {-.030, -.088, -.188}, kScale[] = {.458, .448, .450};
        Planes y{3, int(image.height), int(image.width)};
        for (size_t i = 0; i < image.pixels.size(); ++i)
            y.v[i % 3 * (image.pixels.size() / 3) + i / 3] =
                (image.pixels[i] / 127.5 - 1 - kShift[i % 3]) / kScale[i % 3];
        return y;
    }

    Planes run(int index, const Planes& x) const
    {
        const Module& m = modules_[size_t(index)];
        if (m.kind == Module::Kind::convolution)
            return convolve(m, x, "features." + std::to_string(index));
        if (m.kind == Module::Kind::pool)
            return pooled(m, x);
        Planes y = x;
        for (double& v : y.v)
            v = std::max(v, 0.);
        return y;
    }
    Planes convolve(const Module& m, const Planes& x, const std::string& name) const
    {
        const std::vector<float>&w = weights.values(name + ".weight"), &bias = weights.values(name + ".bias");
        Planes y{m.outputs, (x.height + 2 * m.padding - m.side) / m.stride + 1,
                 (x.width + 2 * m.padding - m.side) / m.stride + 1};
        for (int n = 0; n < m.outputs; ++n) {
            std::fill_n(y.row(n, 0), y.height * y.width, bias[size_t(n)]);
            for (int tap = 0; tap < x.channels * m.side * m.side; ++tap) {
                const int c = tap / (m.side * m.side), i = tap / m.side % m.side, j = tap % m.side;
                const double weight = w[size_t(n) * size_t(x.channels * m.side * m.side) + size_t(tap)];
                for (int oy = 0; oy < y.height; ++oy) {
                    const int sy = oy * m.stride - m.padding + i;
                    if (sy >= 0 && sy < x.height)
                        add_row(y.row(n, oy), y.width, x.row(c, sy), x.width, weight, m.stride, j - m.padding);
                }
            }
        }
        return y;
    }
    static void add_row(double* to, int count, const double* from, int width, double weight, int stride, int shift)
    {
        for (int ox = 0; ox < count; ++ox)
            if (const int sx = ox * stride + shift; sx >= 0 && sx < width)
                to[ox] += weight * from[sx];
    }
    static Planes pooled(const Module& m, const Planes& x)
    {
        Planes y{x.channels, (x.height - m.side) / m.stride + 1, (x.width - m.side) / m.stride + 1};
        for (int n = 0; n < x.channels; ++n)
            for (int oy = 0; oy < y.height; ++oy)
                for (int ox = 0; ox < y.width; ++ox) {
                    double most = x.row(n, oy * m.stride)[ox * m.stride];
                    for (int i = 0; i < m.side * m.side; ++i)
                        most = std::max(most, x.row(n, oy * m.stride + i / m.side)[ox * m.stride + i % m.side]);
                    y.row(n, oy)[ox] = most;
                }
        return y;
    }
    static double layer(const Planes& x, const Planes& y, const std::vector<float>& w)
    {
        const size_t pixels = size_t(x.height) * size_t(x.width);
        double sum = 0;
        for (size_t p = 0; p < pixels; ++p) {
            double xx = 0, yy = 0;
            for (size_t c = 0; c < w.size(); ++c) {
                xx += x.v[c * pixels + p] * x.v[c * pixels + p];
                yy += y.v[c * pixels + p] * y.v[c * pixels + p];
            }
            for (size_t c = 0; c < w.size(); ++c) {
                const double d =
                    x.v[c * pixels + p] / (std::sqrt(xx) + 1e-10) - y.v[c * pixels + p] / (std::sqrt(yy) + 1e-10);
                sum += w[c] * d * d;
            }
        }
        return sum / double(pixels);
    }

    std::vector<Module> modules_;
    std::set<int> ends_; // modules whose outputs are compared
};

} // namespace semrover
