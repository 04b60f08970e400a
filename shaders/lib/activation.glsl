// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// 0.5 x (1 + tanh(u)) = x / (1 + exp(-2u)), u = sqrt(2/pi) (x + 0.044715 x^3); no overflow: exp may be inf, never nan
vec4 gelu_tanh(vec4 x)
{
    const vec4 u = 0.7978845608028654 * (x + 0.044715 * x * x * x);
    return x / (1.0 + exp(-2.0 * u));
}

vec4 silu(vec4 x) { return x / (1.0 + exp(-x)); }

// placeholder until the branch with the accurate one lands
vec4 gelu_erf(vec4 x) { return gelu_tanh(x); }
