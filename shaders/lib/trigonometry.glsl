// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// Choices are between names, so that they compile to a select: these are inlined often, and some drivers take minutes for
// many branches.

// sin and cos to about 1 ulp for |x| <= 1e4: Vulkan only asks for an absolute error of 2^-11 within [-pi, pi].
// Cody-Waite reduction by pi/2 in three parts, then minimax polynomials on [-pi/4, pi/4] (Cephes sinf, cosf).
float sin_quarter(float r)
{
    const float z = r * r;
    return r + r * z * (-1.6666654611e-1 + z * (8.3321608736e-3 + z * -1.9515295891e-4));
}

float cos_quarter(float r)
{
    const float z = r * r;
    return 1.0 - 0.5 * z + z * z * (4.166664568298827e-2 + z * (-1.388731625493765e-3 + z * 2.443315711809948e-5));
}

float sin_quadrant(float x, int shift)
{
    const float n = floor(x * 0.63661977236758134 + 0.5);
    precise float r = x - n * 1.5703125;
    r = r - n * 4.837512969970703125e-4;
    r = r - n * 7.549789948768648e-8;
    const int quadrant = (int(n) + shift) & 3;
    const float sine = sin_quarter(r), cosine = cos_quarter(r);
    const bool even = (quadrant & 1) == 0, positive = quadrant < 2;
    const float value = even ? sine : cosine, negated = -value;
    return positive ? value : negated;
}

float accurate_sin(float x) { return sin_quadrant(x, 0); }
float accurate_cos(float x) { return sin_quadrant(x, 1); }

// atan of 0 <= x <= 1, to about 1 ulp (Cephes atanf)
float atan_octant(float x)
{
    const bool upper = x > 0.41421356;
    const float moved = (x - 1.0) / (x + 1.0), t = upper ? moved : x, z = t * t;
    const float value = t + t * z * (-3.33329491539e-1 + z * (1.99777106478e-1 + z * (-1.38776856032e-1 + z * 8.05374449538e-2)));
    const float above = 0.78539816339 + value;
    return upper ? above : value;
}

// Vulkan only asks for 4096 ulp of atan; 0 at the origin
float accurate_atan2(float y, float x)
{
    const float ax = abs(x), ay = abs(y), high = max(ax, ay);
    const bool away = high > 0.0, steep = ay > ax, behind = x < 0.0, below = y < 0.0;
    const float ratio = min(ax, ay) / high, octant = atan_octant(away ? ratio : 0.0), rest = 1.57079632679 - octant;
    const float quadrant = steep ? rest : octant, beyond = 3.14159265359 - quadrant;
    const float upper = behind ? beyond : quadrant, lower = -upper;
    return below ? lower : upper;
}

float accurate_asin(float x) { return accurate_atan2(x, sqrt(max((1.0 - x) * (1.0 + x), 0.0))); }
