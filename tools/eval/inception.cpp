// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/inception.h"

#include "kernels/recognition.h"
#include "tools/eval/folded_weights.h"

#include <numeric>
#include <optional>

namespace semrover {

namespace {

struct Convolution {
    uint32_t layer;
    ConvOptions::Taps taps;
    uint32_t stride;
};

// a pool or none, convolutions one after the other, then one or several of which each sees the last one's output
struct Branch {
    std::optional<PoolOptions> pool;
    std::vector<Convolution> chain;
    std::vector<Convolution> heads;
};

// branches that see the same input, their outputs concatenated along channels
struct Block {
    std::vector<Branch> branches;
};

constexpr PoolOptions kMeanPool{true, 3, 3, 1, 1, 1, 1}, kMaxPool{false, 3, 3, 1, 1, 1, 1};
constexpr PoolOptions kHalvingPool{false, 3, 3, 2, 2, 0, 0};

// how a convolution is declared: its name after the block's, taps, outputs of the usual network, stride; at stride 1
// padded to keep the size
struct Row {
    const char* name;
    uint32_t height, width, outputs;
    uint32_t stride = 1;
    bool padded = true;
};

// declares blocks, and knows how many channels each branch of the last one has
class Builder {
  public:
    explicit Builder(FoldedWeights& weights) : weights_(weights) {}

    struct Rows {
        std::optional<PoolOptions> pool;
        std::vector<Row> chain, heads;
    };
    Block block(const std::string& name, const std::vector<Rows>& branches)
    {
        Block b;
        std::vector<uint32_t> outputs;
        for (const Rows& rows : branches) {
            Branch branch{rows.pool, {}, {}};
            std::vector<uint32_t> channels = channels_;
            for (const Row& row : rows.chain)
                channels = {declare(name, row, channels, branch.chain)};
            std::vector<uint32_t> ends;
            for (const Row& row : rows.heads)
                ends.push_back(declare(name, row, channels, branch.heads));
            outputs.insert(outputs.end(), ends.empty() ? channels.begin() : ends.begin(),
                           ends.empty() ? channels.end() : ends.end());
            b.branches.push_back(std::move(branch));
        }
        channels_ = outputs;
        return b;
    }
    const std::vector<uint32_t>& channels() const { return channels_; }

  private:
    uint32_t declare(const std::string& block, const Row& row, const std::vector<uint32_t>& inputs,
                     std::vector<Convolution>& into)
    {
        Convolution c{0, {row.height, row.width, 0, 0}, row.stride};
        if (row.stride == 1 && row.padded) {
            c.taps.padding_y = row.height / 2;
            c.taps.padding_x = row.width / 2;
        }
        const std::string name = block + row.name;
        c.layer = weights_.add(name + ".conv", name + ".bn", {c.taps, inputs, row.outputs, false, kInceptionEps});
        into.push_back(c);
        return weights_.outputs(c.layer);
    }

    FoldedWeights& weights_;
    std::vector<uint32_t> channels_ = {3};
};

Block block_a(Builder& b, const std::string& name, uint32_t pooled)
{
    return b.block(
        name, {{{}, {{".branch1x1", 1, 1, 64}}, {}},
               {{}, {{".branch5x5_1", 1, 1, 48}, {".branch5x5_2", 5, 5, 64}}, {}},
               {{}, {{".branch3x3dbl_1", 1, 1, 64}, {".branch3x3dbl_2", 3, 3, 96}, {".branch3x3dbl_3", 3, 3, 96}}, {}},
               {kMeanPool, {{".branch_pool", 1, 1, pooled}}, {}}});
}

Block block_b(Builder& b, const std::string& name)
{
    return b.block(
        name,
        {{{}, {{".branch3x3", 3, 3, 384, 2}}, {}},
         {{}, {{".branch3x3dbl_1", 1, 1, 64}, {".branch3x3dbl_2", 3, 3, 96}, {".branch3x3dbl_3", 3, 3, 96, 2}}, {}},
         {kHalvingPool, {}, {}}});
}

Block block_c(Builder& b, const std::string& name, uint32_t n)
{
    return b.block(name, {{{}, {{".branch1x1", 1, 1, 192}}, {}},
                          {{}, {{".branch7x7_1", 1, 1, n}, {".branch7x7_2", 1, 7, n}, {".branch7x7_3", 7, 1, 192}}, {}},
                          {{},
                           {{".branch7x7dbl_1", 1, 1, n},
                            {".branch7x7dbl_2", 7, 1, n},
                            {".branch7x7dbl_3", 1, 7, n},
                            {".branch7x7dbl_4", 7, 1, n},
                            {".branch7x7dbl_5", 1, 7, 192}},
                           {}},
                          {kMeanPool, {{".branch_pool", 1, 1, 192}}, {}}});
}

Block block_d(Builder& b, const std::string& name)
{
    return b.block(name, {{{}, {{".branch3x3_1", 1, 1, 192}, {".branch3x3_2", 3, 3, 320, 2}}, {}},
                          {{},
                           {{".branch7x7x3_1", 1, 1, 192},
                            {".branch7x7x3_2", 1, 7, 192},
                            {".branch7x7x3_3", 7, 1, 192},
                            {".branch7x7x3_4", 3, 3, 192, 2}},
                           {}},
                          {kHalvingPool, {}, {}}});
}

Block block_e(Builder& b, const std::string& name, const PoolOptions& pool)
{
    return b.block(name,
                   {{{}, {{".branch1x1", 1, 1, 320}}, {}},
                    {{}, {{".branch3x3_1", 1, 1, 384}}, {{".branch3x3_2a", 1, 3, 384}, {".branch3x3_2b", 3, 1, 384}}},
                    {{},
                     {{".branch3x3dbl_1", 1, 1, 448}, {".branch3x3dbl_2", 3, 3, 384}},
                     {{".branch3x3dbl_3a", 1, 3, 384}, {".branch3x3dbl_3b", 3, 1, 384}}},
                    {pool, {{".branch_pool", 1, 1, 192}}, {}}});
}

std::vector<Block> all_blocks(Builder& b)
{
    std::vector<Block> blocks;
    blocks.push_back(b.block(
        "", {{{},
              {{"Conv2d_1a_3x3", 3, 3, 32, 2}, {"Conv2d_2a_3x3", 3, 3, 32, 1, false}, {"Conv2d_2b_3x3", 3, 3, 64}},
              {}}}));
    blocks.push_back(
        b.block("", {{kHalvingPool, {{"Conv2d_3b_1x1", 1, 1, 80}, {"Conv2d_4a_3x3", 3, 3, 192, 1, false}}, {}}}));
    blocks.push_back(b.block("", {{kHalvingPool, {}, {}}}));
    blocks.push_back(block_a(b, "Mixed_5b", 32));
    blocks.push_back(block_a(b, "Mixed_5c", 64));
    blocks.push_back(block_a(b, "Mixed_5d", 64));
    blocks.push_back(block_b(b, "Mixed_6a"));
    blocks.push_back(block_c(b, "Mixed_6b", 128));
    blocks.push_back(block_c(b, "Mixed_6c", 160));
    blocks.push_back(block_c(b, "Mixed_6d", 160));
    blocks.push_back(block_c(b, "Mixed_6e", 192));
    blocks.push_back(block_d(b, "Mixed_7a"));
    blocks.push_back(block_e(b, "Mixed_7b", kMeanPool));
    blocks.push_back(block_e(b, "Mixed_7c", kMaxPool));
    return blocks;
}

// a block as a part of a graph: the last op of every branch writes its columns of one tensor
class BlockRunner {
  public:
    BlockRunner(Graph& g, const FoldedWeights& weights, FeatureMap x, const Block& block)
        : g_(g), weights_(weights), x_(x)
    {
        for (const Branch& branch : block.branches)
            for (const uint32_t n : widths(branch))
                width_ += round_up(n, kRowPadding);
    }

    void run(const Branch& branch)
    {
        FeatureMap x = x_;
        if (branch.pool && branch.chain.empty() && branch.heads.empty()) {
            y_ = pool2d(g_, x, *branch.pool, {.whole = y_.data, .col = col_});
            return;
        }
        if (branch.pool)
            x = pool2d(g_, x, *branch.pool);
        for (size_t i = 0; i < branch.chain.size(); ++i) {
            const FeatureMap c = convolve(branch.chain[i], x);
            if (i + 1 == branch.chain.size() && branch.heads.empty())
                finish(c);
            else
                x = c.with(relu(g_, c.data));
        }
        for (const Convolution& head : branch.heads)
            finish(convolve(head, x));
    }
    FeatureMap result() const { return y_; }

  private:
    std::vector<uint32_t> widths(const Branch& branch) const
    {
        if (branch.chain.empty() && branch.heads.empty())
            return {x_.channels()};
        std::vector<uint32_t> outputs;
        for (const Convolution& head : branch.heads)
            outputs.push_back(weights_.outputs(head.layer));
        return outputs.empty() ? std::vector{weights_.outputs(branch.chain.back().layer)} : outputs;
    }
    FeatureMap convolve(const Convolution& c, FeatureMap x)
    {
        ConvOptions options;
        options.taps = c.taps;
        options.stride = c.stride;
        options.dtype = DType::f32;
        return conv2d(g_, x, {}, weights_.weight(g_, c.layer), weights_.bias(g_, c.layer), options);
    }
    void finish(FeatureMap c)
    {
        if (!y_.valid())
            y_ = feature_map(g_, c.batch, c.height, c.width, width_, DType::f32, "block");
        relu(g_, c.data, {.whole = y_.data, .col = col_});
        col_ += round_up(c.channels(), kRowPadding);
    }

    Graph& g_;
    const FoldedWeights& weights_;
    FeatureMap x_, y_;
    uint32_t width_ = 0, col_ = 0;
};

} // namespace

struct Inception::Impl {
    FoldedWeights weights;
    std::vector<Block> blocks;
    std::vector<uint32_t> channels; // of the last block's branches

    explicit Impl(SafetensorsSet file) : weights(std::move(file))
    {
        Builder builder(weights);
        blocks = all_blocks(builder);
        channels = builder.channels();
        weights.allow("fc.weight");
        weights.allow("fc.bias");
    }
};

Inception::Inception(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Inception::~Inception() = default;

Result<std::unique_ptr<Inception>> Inception::load(Device& device, const Path& path)
{
    SR_TRY(SafetensorsSet file, SafetensorsSet::open(path));
    auto impl = std::make_unique<Impl>(std::move(file));
    SR_CHECK(impl->weights.load(device));
    return std::unique_ptr<Inception>(new Inception(std::move(impl)));
}

uint32_t Inception::features() const
{
    return std::accumulate(impl_->channels.begin(), impl_->channels.end(), 0u);
}

FeatureMap Inception::forward(Graph& g, FeatureMap x) const
{
    for (const Block& block : impl_->blocks) {
        BlockRunner runner(g, impl_->weights, x, block);
        for (const Branch& branch : block.branches)
            runner.run(branch);
        x = runner.result();
    }
    return pool2d(g, x, {true, x.height, x.width, 1, 1, 0, 0});
}

std::vector<double> Inception::unpadded(std::span<const float> row) const
{
    std::vector<double> y;
    size_t first = 0;
    for (const uint32_t n : impl_->channels) {
        y.insert(y.end(), row.begin() + int64_t(first), row.begin() + int64_t(first + n));
        first += round_up(n, kRowPadding);
    }
    return y;
}

} // namespace semrover
