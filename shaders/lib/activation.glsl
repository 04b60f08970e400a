// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// 0.5 x (1 + tanh(u)) = x / (1 + exp(-2u)), u = sqrt(2/pi) (x + 0.044715 x^3); no overflow: exp may be inf, never nan
vec4 gelu_tanh(vec4 x)
{
    const vec4 u = 0.7978845608028654 * (x + 0.044715 * x * x * x);
    return x / (1.0 + exp(-2.0 * u));
}

vec4 silu(vec4 x) { return x / (1.0 + exp(-x)); }

// erf(x) = x p(x^2) / q(x^2), to 1 ulp of 1 from 3.92 on; the coefficients are a minimax fit of the relative error on
// [0, 3.92] (iteratively reweighted least squares in 40 digits): 1.9e-8 before rounding
vec4 erf(vec4 x)
{
    x = clamp(x, -3.92, 3.92);
    const vec4 t = x * x;
    vec4 p = t * 2.0503397e-6 + 2.84856473e-4;
    p = p * t + 3.76433713e-3;
    p = p * t + 5.27447317e-2;
    p = p * t + 0.190376248;
    p = p * t + 1.12837915;
    vec4 q = t * 3.8092991e-5 + 1.16223119e-3;
    q = q * t + 1.49666329e-2;
    q = q * t + 0.114096629;
    q = q * t + 0.502049303;
    q = q * t + 1.0;
    return x * p / q;
}

// 0.5 x (1 + erf(x / sqrt(2)))
vec4 gelu_erf(vec4 x) { return 0.5 * x * (1.0 + erf(x * 0.7071067811865476)); }
