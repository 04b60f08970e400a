#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = sums of products of matrices whose factors come from registers, shared memory or x: how fast matrix units are
// when they are fed so (semrover bench tiles). tools/dev/spirv compiles it.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_KHR_cooperative_matrix : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require
#include "factor_rate.h"

layout(local_size_x = 128, local_size_x_id = 33) in; // kThreads
layout(constant_id = 0) const uint kSource = 0;      // of factors: 0 registers, 1 shared memory, 2 x
layout(constant_id = 1) const uint kProducts = 16;   // of each eight factors that are loaded: 4, 8, 16 or 32
layout(push_constant) uniform Push { FactorRatePush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; };  // fp16: a factor after the other
layout(binding = 1) writeonly buffer Y { float y[]; }; // a matrix of a subgroup
#include "lib/cooperative_matrix.glsl"

// shared memory has rows of four factors as those of gemm_tile.coopmat.glsl, 16 bytes longer than they need
const uint kFactor = (kMatM > kMatN ? kMatM : kMatN) * kMatK / 8, kRowUnits = 4 * kMatK / 8 + 1, kRows = 128;
shared uvec4 staged[kRows * kRowUnits];

#define MatrixX coopmat<float16_t, gl_ScopeSubgroup, kMatM, kMatK, gl_MatrixUseA>
#define MatrixW coopmat<float16_t, gl_ScopeSubgroup, kMatK, kMatN, gl_MatrixUseB>
#define MatrixY coopmat<float, gl_ScopeSubgroup, kMatM, kMatN, gl_MatrixUseAccumulator>

MatrixX a[4];
MatrixW b[4];
MatrixY sums[16];

uint unit_of(uint factor) { return factor * kFactor & (p.units - 1); }
uint staged_unit_of(uint factor) { return factor / 4 * 16 % kRows * kRowUnits + factor % 4 * kMatK / 8; }

// eight factors, from this one on
void load_factors(uint factor)
{
    [[unroll]] for (uint i = 0; i < 4; ++i)
        if (kSource == 1) {
            coopMatLoad(a[i], staged, staged_unit_of(factor + i), kRowUnits, gl_CooperativeMatrixLayoutRowMajor);
            coopMatLoad(b[i], staged, staged_unit_of(factor + 4 + i), kRowUnits, gl_CooperativeMatrixLayoutColumnMajor);
        } else {
            coopMatLoad(a[i], x, unit_of(factor + i), kMatK / 8, gl_CooperativeMatrixLayoutRowMajor);
            coopMatLoad(b[i], x, unit_of(factor + 4 + i), kMatK / 8, gl_CooperativeMatrixLayoutColumnMajor);
        }
}

void main()
{
    for (uint i = gl_LocalInvocationID.x; kSource == 1 && i < kRows * kRowUnits; i += kThreads)
        staged[i] = x[i & (p.units - 1)];
    barrier();
    [[unroll]] for (uint i = 0; i < 16; ++i)
        sums[i] = MatrixY(0.0);
    const uint subgroup = gl_WorkGroupID.x * gl_NumSubgroups + gl_SubgroupID;
    uint factor = subgroup * 8 * 37; // subgroups go through all of x, each from its own place
    load_factors(factor);
    for (uint round = 0; round < p.rounds; ++round)
        [[unroll]] for (uint n = 0; n < max(16, kProducts); ++n) {
            if (kSource != 0 && n % kProducts == 0) {
                load_factors(factor);
                factor += 8;
            }
            sums[n % 16] = coopMatMulAdd(a[n % 4], b[(n / 4 + n) % 4], sums[n % 16]);
        }
    [[unroll]] for (uint i = 1; i < 16; ++i)
        sums[0] = sums[0] + sums[i];
    coopMatStore(sums[0], y, subgroup * kMatM * kMatN, kMatN, gl_CooperativeMatrixLayoutRowMajor);
}
