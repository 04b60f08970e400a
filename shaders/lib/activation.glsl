// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// 0.5 x (1 + tanh(u)) = x / (1 + exp(-2u)), u = sqrt(2/pi) (x + 0.044715 x^3); no overflow: exp may be inf, never nan
vec4 gelu_tanh(vec4 x)
{
    const vec4 u = 0.7978845608028654 * (x + 0.044715 * x * x * x);
    return x / (1.0 + exp(-2.0 * u));
}

vec4 silu(vec4 x) { return x / (1.0 + exp(-x)); }

// 0.5 x (1 + erf(x / sqrt(2))), with erf from Abramowitz and Stegun 7.1.26: 1.5e-7 absolute, and no cancellation where
// x is negative
vec4 gelu_erf(vec4 x)
{
    const vec4 z = abs(x) * 0.7071067811865476;
    const vec4 t = 1.0 / (1.0 + 0.3275911 * z);
    const vec4 tail = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429)))) * exp(-z * z);
    return 0.5 * x * mix(tail, 2.0 - tail, greaterThanEqual(x, vec4(0.0)));
}
