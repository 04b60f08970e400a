// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/schema.h"

namespace semrover {

void Schema::resnet(const std::string& name, uint32_t in, uint32_t out, uint32_t time)
{
    norm(name + ".norm1", in);
    conv(name + ".conv1", out, in, 3);
    if (time)
        linear(name + ".time_emb_proj", out, time);
    norm(name + ".norm2", out);
    conv(name + ".conv2", out, out, 3);
    if (in != out)
        conv(name + ".conv_shortcut", out, in, 1);
}

void Schema::frame_resnet(const std::string& name, uint32_t channels, uint32_t time)
{
    norm(name + ".norm1", channels);
    frame_conv(name + ".conv1", channels, channels, 3);
    if (time)
        linear(name + ".time_emb_proj", channels, time);
    norm(name + ".norm2", channels);
    frame_conv(name + ".conv2", channels, channels, 3);
}

void Schema::video_resnet(const std::string& name, uint32_t in, uint32_t out, uint32_t time)
{
    resnet(name + ".spatial_res_block", in, out, time);
    frame_resnet(name + ".temporal_res_block", out, time);
    specs.push_back({name + ".time_mixer.mix_factor", {1}});
}

void Schema::attention(const std::string& name, uint32_t channels, uint32_t context)
{
    matrix(name + ".to_q.weight", channels, channels);
    matrix(name + ".to_k.weight", channels, context);
    matrix(name + ".to_v.weight", channels, context);
    linear(name + ".to_out.0", channels, channels);
}

void Schema::feed_forward(const std::string& name, uint32_t channels)
{
    linear(name + ".net.0.proj", 8 * channels, channels); // values and gates, 4 C each
    linear(name + ".net.2", channels, 4 * channels);
}

void Schema::transformer_block(const std::string& name, uint32_t channels, uint32_t context)
{
    for (const char* part : {".norm1", ".norm2", ".norm3"})
        norm(name + part, channels);
    attention(name + ".attn1", channels, channels);
    attention(name + ".attn2", channels, context);
    feed_forward(name + ".ff", channels);
}

} // namespace semrover
