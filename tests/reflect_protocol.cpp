// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: posix
// the build tool that reads shaders refuses those that break runtime/graph/shader_interface.h
#include "tests/support/program_result.h"

#include <gtest/gtest.h>

namespace semrover {
namespace reflect_protocol_test {

struct Declarations {
    std::string constants = {}, push = "uint rows;", y = "writeonly buffer Y { uint y[]; }", more = {};
};

std::string shader(const Declarations& d)
{
    return "#version 460\nlayout(local_size_x = 64) in;\n" + d.constants + "\nlayout(push_constant) uniform Push { " +
           d.push + " } p;\nlayout(binding = 0) readonly buffer X { uint x[]; };\nlayout(binding = 1) " + d.y +
           ";\nvoid main() { " + (d.y.starts_with("readonly") ? "uint v = x[0] + y[0];" : "y[0] = x[0];") + d.more +
           " }\n";
}

// what the reflector says of an op of these variants; empty: it took them
std::string fault_of(const std::vector<std::pair<std::string, Declarations>>& variants)
{
    const ScratchFolder folder;
    std::string arguments = (folder / "op.spv.h").string() + " op";
    for (const auto& [name, declarations] : variants) {
        const std::string file = name.empty() ? "op" : "op." + name;
        folder.put(file + ".comp", shader(declarations));
        const std::string spirv = (folder / (file + ".spv")).string();
        const ProgramResult compiled =
            run_program_line(SEMROVER_GLSLANG, "-V --quiet --target-env vulkan1.2 -o " + spirv + " " +
                                                   (folder / (file + ".comp")).string());
        EXPECT_EQ(compiled.code, 0) << compiled.out << compiled.err;
        arguments += " " + spirv;
    }
    const ProgramResult result = run_program_line(SEMROVER_REFLECT, arguments);
    EXPECT_EQ(result.code == 0, result.err.empty()) << result.err;
    return result.err;
}

std::string fault(const Declarations& declarations)
{
    return fault_of({{"", declarations}});
}

bool says(const std::string& text, std::string_view part)
{
    return text.find(part) != std::string::npos;
}

TEST(Protocol, a_shader_that_keeps_it_is_taken)
{
    EXPECT_EQ(fault(Declarations{}), "");
    EXPECT_EQ(fault({.constants = "layout(constant_id = 0) const uint kTypeX = 1;\n"
                                  "layout(constant_id = 1) const uint kTileM = 16;",
                     .push = "uint rows; uint first_row; uint x_first; uint x_ld;"}),
              "");
}

TEST(Protocol, names_that_belong_to_no_binding_are_refused)
{
    EXPECT_TRUE(says(fault({.constants = "layout(constant_id = 0) const uint kTypeZ = 1;"}),
                     "constant kTypeZ belongs to no binding"));
    EXPECT_TRUE(
        says(fault({.constants = "layout(constant_id = 0) const bool kTypeX = false;"}), "constant kTypeX is a bool"));
    EXPECT_TRUE(says(fault({.push = "uint rows; uint z_first;"}), "push member z_first belongs to no binding"));
}

TEST(Protocol, what_the_planner_needs_together_is_declared_together)
{
    EXPECT_TRUE(says(fault({.push = "uint first_row;"}), "first_row without rows"));
}

TEST(Protocol, what_vulkan_leaves_open_is_refused)
{
    EXPECT_TRUE(says(fault({.more = "y[1] = uint(int(x[1]) % int(x[2]));"}), "% of signed numbers"));
    EXPECT_EQ(fault({.more = "y[1] = x[1] % x[2];"}), "");
}

TEST(Protocol, variants_of_an_op_declare_the_same)
{
    const Declarations plain;
    EXPECT_TRUE(says(fault_of({{"cpu", plain}, {"simt", {.push = "uint rows; uint more;"}}}),
                     "variant simt: a push struct of 8 bytes, in the first variant 4"));
    EXPECT_TRUE(says(fault_of({{"cpu", plain}, {"simt", {.y = "writeonly buffer Z { uint y[]; }"}}}),
                     "variant simt: binding 1 is called Z, in the first variant Y"));
    EXPECT_TRUE(says(fault_of({{"cpu", plain}, {"simt", {.y = "buffer Y { uint y[]; }"}}}),
                     "variant simt: binding Y has another number or access than in the first variant"));
    EXPECT_TRUE(
        says(fault_of({{"cpu", {.push = "uint rows; uint x_ld;"}}, {"simt", {.push = "uint x_ld; uint rows;"}}}),
             "variant simt: push member x_ld at byte 0, in the first variant rows at byte 0"));
    const Declarations first{.constants = "layout(constant_id = 0) const uint kTileM = 16;"},
        second{.constants = "layout(constant_id = 1) const uint kTileM = 16;"};
    EXPECT_TRUE(says(fault_of({{"cpu", first}, {"simt", second}}),
                     "variant simt: constant kTileM has id 1, in the first variant 0"));
}

} // namespace reflect_protocol_test
} // namespace semrover
