// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/support/state_dict.h"

#include <algorithm>

// Inception v3 with FID's pools in double, one function per module, naively: conv, batch norm, relu, as PyTorch names
// them
namespace semrover {

struct Planes { // [channels, height, width]
    int channels = 0, height = 0, width = 0;
    std::vector<double> v;

    Planes(int c, int h, int w) : channels(c), height(h), width(w), v(size_t(c) * h * w) {}
    double& at(int c, int y, int x) { return v[(size_t(c) * height + y) * width + x]; }
    double at(int c, int y, int x) const { return v[(size_t(c) * height + y) * width + x]; }
};

struct Padding {
    int y = 0, x = 0;
};

class InceptionReference {
  public:
    explicit InceptionReference(const StateDict& weights) : w_(weights) {}

    // image of 3 planes, -1..1 -> features
    std::vector<double> operator()(const Planes& image) const
    {
        Planes x = basic(image, "Conv2d_1a_3x3", 2);
        x = basic(x, "Conv2d_2a_3x3");
        x = basic(x, "Conv2d_2b_3x3", 1, {1, 1});
        x = max_pool(x, 2, 0);
        x = basic(x, "Conv2d_3b_1x1");
        x = basic(x, "Conv2d_4a_3x3");
        x = max_pool(x, 2, 0);
        for (const char* name : {"Mixed_5b", "Mixed_5c", "Mixed_5d"})
            x = a(x, name);
        x = b(x, "Mixed_6a");
        for (const char* name : {"Mixed_6b", "Mixed_6c", "Mixed_6d", "Mixed_6e"})
            x = c(x, name);
        x = d(x, "Mixed_7a");
        x = e(x, "Mixed_7b", mean_pool(x));
        x = e(x, "Mixed_7c", max_pool(x, 1, 1));
        std::vector<double> features;
        for (int n = 0; n < x.channels; ++n) {
            double sum = 0;
            for (int i = 0; i < x.height * x.width; ++i)
                sum += x.v[size_t(n) * x.height * x.width + i];
            features.push_back(sum / (x.height * x.width));
        }
        return features;
    }

  private:
    Planes basic(const Planes& x, const std::string& name, int stride = 1, Padding pad = {}) const
    {
        const auto& weight = w_.values(name + ".conv.weight");
        const int outputs = int(w_.size(name + ".conv.weight", 0)), kh = int(w_.size(name + ".conv.weight", 2)),
                  kw = int(w_.size(name + ".conv.weight", 3));
        Planes y(outputs, (x.height + 2 * pad.y - kh) / stride + 1, (x.width + 2 * pad.x - kw) / stride + 1);
        for (int n = 0; n < outputs; ++n) {
            const double scale = double(w_.values(name + ".bn.weight")[n]) /
                                 std::sqrt(double(w_.values(name + ".bn.running_var")[n]) + 0.001);
            for (int oy = 0; oy < y.height; ++oy)
                for (int ox = 0; ox < y.width; ++ox) {
                    double sum = 0;
                    for (int k = 0; k < x.channels; ++k)
                        for (int i = std::max(0, pad.y - oy * stride); i < kh; ++i)
                            for (int j = std::max(0, pad.x - ox * stride); j < kw; ++j) {
                                const int sy = oy * stride - pad.y + i, sx = ox * stride - pad.x + j;
                                if (sy < x.height && sx < x.width)
                                    sum += weight[((size_t(n) * x.channels + k) * kh + i) * kw + j] * x.at(k, sy, sx);
                            }
                    const double v =
                        (sum - w_.values(name + ".bn.running_mean")[n]) * scale + w_.values(name + ".bn.bias")[n];
                    y.at(n, oy, ox) = std::max(v, 0.);
                }
        }
        return y;
    }
    static Planes max_pool(const Planes& x, int stride, int pad)
    {
        Planes y(x.channels, (x.height + 2 * pad - 3) / stride + 1, (x.width + 2 * pad - 3) / stride + 1);
        for (int n = 0; n < x.channels; ++n)
            for (int oy = 0; oy < y.height; ++oy)
                for (int ox = 0; ox < y.width; ++ox) {
                    double most = -1e300;
                    for (int i = 0; i < 9; ++i) {
                        const int sy = oy * stride - pad + i / 3, sx = ox * stride - pad + i % 3;
                        if (sy >= 0 && sx >= 0 && sy < x.height && sx < x.width)
                            most = std::max(most, x.at(n, sy, sx));
                    }
                    y.at(n, oy, ox) = most;
                }
        return y;
    }
    static Planes mean_pool(const Planes& x) // 3 x 3, stride 1, padding 1, which does not count
    {
        Planes y(x.channels, x.height, x.width);
        for (int n = 0; n < x.channels; ++n)
            for (int oy = 0; oy < y.height; ++oy)
                for (int ox = 0; ox < y.width; ++ox) {
                    double sum = 0;
                    int count = 0;
                    for (int sy = std::max(oy - 1, 0); sy <= std::min(oy + 1, x.height - 1); ++sy)
                        for (int sx = std::max(ox - 1, 0); sx <= std::min(ox + 1, x.width - 1); ++sx, ++count)
                            sum += x.at(n, sy, sx);
                    y.at(n, oy, ox) = sum / count;
                }
        return y;
    }
    static Planes cat(const std::vector<Planes>& parts)
    {
        Planes y(0, parts[0].height, parts[0].width);
        for (const Planes& p : parts) {
            EXPECT_EQ(p.v.size(), size_t(p.channels) * y.height * y.width);
            y.channels += p.channels;
            y.v.insert(y.v.end(), p.v.begin(), p.v.end());
        }
        return y;
    }

    Planes a(const Planes& x, const std::string& n) const
    {
        const Planes five = basic(basic(x, n + ".branch5x5_1"), n + ".branch5x5_2", 1, {2, 2});
        const Planes twice = basic(basic(x, n + ".branch3x3dbl_1"), n + ".branch3x3dbl_2", 1, {1, 1});
        return cat({basic(x, n + ".branch1x1"), five, basic(twice, n + ".branch3x3dbl_3", 1, {1, 1}),
                    basic(mean_pool(x), n + ".branch_pool")});
    }
    Planes b(const Planes& x, const std::string& n) const
    {
        const Planes twice = basic(basic(x, n + ".branch3x3dbl_1"), n + ".branch3x3dbl_2", 1, {1, 1});
        return cat({basic(x, n + ".branch3x3", 2), basic(twice, n + ".branch3x3dbl_3", 2), max_pool(x, 2, 0)});
    }
    Planes c(const Planes& x, const std::string& n) const
    {
        Planes seven = basic(basic(x, n + ".branch7x7_1"), n + ".branch7x7_2", 1, {0, 3});
        seven = basic(seven, n + ".branch7x7_3", 1, {3, 0});
        Planes twice = basic(basic(x, n + ".branch7x7dbl_1"), n + ".branch7x7dbl_2", 1, {3, 0});
        twice = basic(twice, n + ".branch7x7dbl_3", 1, {0, 3});
        twice = basic(twice, n + ".branch7x7dbl_4", 1, {3, 0});
        twice = basic(twice, n + ".branch7x7dbl_5", 1, {0, 3});
        return cat({basic(x, n + ".branch1x1"), seven, twice, basic(mean_pool(x), n + ".branch_pool")});
    }
    Planes d(const Planes& x, const std::string& n) const
    {
        const Planes three = basic(basic(x, n + ".branch3x3_1"), n + ".branch3x3_2", 2);
        Planes seven = basic(basic(x, n + ".branch7x7x3_1"), n + ".branch7x7x3_2", 1, {0, 3});
        seven = basic(seven, n + ".branch7x7x3_3", 1, {3, 0});
        return cat({three, basic(seven, n + ".branch7x7x3_4", 2), max_pool(x, 2, 0)});
    }
    Planes e(const Planes& x, const std::string& n, const Planes& pooled) const
    {
        const Planes three = basic(x, n + ".branch3x3_1");
        const Planes twice = basic(basic(x, n + ".branch3x3dbl_1"), n + ".branch3x3dbl_2", 1, {1, 1});
        return cat({basic(x, n + ".branch1x1"), basic(three, n + ".branch3x3_2a", 1, {0, 1}),
                    basic(three, n + ".branch3x3_2b", 1, {1, 0}), basic(twice, n + ".branch3x3dbl_3a", 1, {0, 1}),
                    basic(twice, n + ".branch3x3dbl_3b", 1, {1, 0}), basic(pooled, n + ".branch_pool")});
    }

    const StateDict& w_;
};

// every tensor of the network; the usual numbers of channels divided by 'divisor', and at least two
class InceptionWeights {
  public:
    explicit InceptionWeights(uint64_t divisor) : divisor_(divisor)
    {
        uint64_t x = add("Conv2d_1a_3x3", 32, 3, 3, 3);
        x = add("Conv2d_2a_3x3", 32, x, 3, 3);
        x = add("Conv2d_2b_3x3", 64, x, 3, 3);
        x = add("Conv2d_3b_1x1", 80, x, 1, 1);
        x = add("Conv2d_4a_3x3", 192, x, 3, 3);
        for (const auto& [name, pooled] : {std::pair{"Mixed_5b", 32}, {"Mixed_5c", 64}, {"Mixed_5d", 64}})
            x = a(name, x, uint64_t(pooled));
        x = b(x);
        for (const auto& [name, n] :
             {std::pair{"Mixed_6b", 128}, {"Mixed_6c", 160}, {"Mixed_6d", 160}, {"Mixed_6e", 192}})
            x = c(name, x, uint64_t(n));
        x = d(x);
        for (const char* name : {"Mixed_7b", "Mixed_7c"})
            x = e(name, x);
        features = x;
    }
    StateDict weights;
    uint64_t features = 0;

  private:
    uint64_t add(const std::string& name, uint64_t outputs, uint64_t inputs, uint64_t height, uint64_t width)
    {
        const uint64_t n = std::max<uint64_t>(outputs / divisor_, 2);
        weights.add_layer(name + ".conv", name + ".bn", n, inputs, height, width, false);
        return n;
    }
    uint64_t a(const std::string& n, uint64_t x, uint64_t pooled)
    {
        const uint64_t one = add(n + ".branch1x1", 64, x, 1, 1);
        const uint64_t five = add(n + ".branch5x5_2", 64, add(n + ".branch5x5_1", 48, x, 1, 1), 5, 5);
        uint64_t twice = add(n + ".branch3x3dbl_2", 96, add(n + ".branch3x3dbl_1", 64, x, 1, 1), 3, 3);
        twice = add(n + ".branch3x3dbl_3", 96, twice, 3, 3);
        return one + five + twice + add(n + ".branch_pool", pooled, x, 1, 1);
    }
    uint64_t b(uint64_t x)
    {
        const uint64_t three = add("Mixed_6a.branch3x3", 384, x, 3, 3);
        uint64_t twice = add("Mixed_6a.branch3x3dbl_1", 64, x, 1, 1);
        twice = add("Mixed_6a.branch3x3dbl_2", 96, twice, 3, 3);
        return three + add("Mixed_6a.branch3x3dbl_3", 96, twice, 3, 3) + x;
    }
    uint64_t c(const std::string& n, uint64_t x, uint64_t inner)
    {
        const uint64_t one = add(n + ".branch1x1", 192, x, 1, 1);
        uint64_t seven = add(n + ".branch7x7_2", inner, add(n + ".branch7x7_1", inner, x, 1, 1), 1, 7);
        seven = add(n + ".branch7x7_3", 192, seven, 7, 1);
        uint64_t twice = add(n + ".branch7x7dbl_2", inner, add(n + ".branch7x7dbl_1", inner, x, 1, 1), 7, 1);
        twice = add(n + ".branch7x7dbl_4", inner, add(n + ".branch7x7dbl_3", inner, twice, 1, 7), 7, 1);
        twice = add(n + ".branch7x7dbl_5", 192, twice, 1, 7);
        return one + seven + twice + add(n + ".branch_pool", 192, x, 1, 1);
    }
    uint64_t d(uint64_t x)
    {
        const uint64_t three = add("Mixed_7a.branch3x3_2", 320, add("Mixed_7a.branch3x3_1", 192, x, 1, 1), 3, 3);
        uint64_t seven = add("Mixed_7a.branch7x7x3_2", 192, add("Mixed_7a.branch7x7x3_1", 192, x, 1, 1), 1, 7);
        seven = add("Mixed_7a.branch7x7x3_3", 192, seven, 7, 1);
        return three + add("Mixed_7a.branch7x7x3_4", 192, seven, 3, 3) + x;
    }
    uint64_t e(const std::string& n, uint64_t x)
    {
        const uint64_t one = add(n + ".branch1x1", 320, x, 1, 1), three = add(n + ".branch3x3_1", 384, x, 1, 1);
        const uint64_t left = add(n + ".branch3x3_2a", 384, three, 1, 3),
                       up = add(n + ".branch3x3_2b", 384, three, 3, 1);
        const uint64_t twice = add(n + ".branch3x3dbl_2", 384, add(n + ".branch3x3dbl_1", 448, x, 1, 1), 3, 3);
        const uint64_t twice_left = add(n + ".branch3x3dbl_3a", 384, twice, 1, 3);
        const uint64_t twice_up = add(n + ".branch3x3dbl_3b", 384, twice, 3, 1);
        return one + left + up + twice_left + twice_up + add(n + ".branch_pool", 192, x, 1, 1);
    }
    uint64_t divisor_;
};

} // namespace semrover
