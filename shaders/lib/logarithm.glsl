// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// log(x) to about 1 ulp for normal x > 0, exactly 0 at 1 and below 0 left of it: Vulkan only asks for an absolute error of
// 2^-21 around 1, enough to make sqrt(-log(x)) not a number. Cephes logf: x = m 2^e with m in [sqrt(1/2), sqrt(2)).
float accurate_log(float x)
{
    const uint bits = floatBitsToUint(x) - 0x3f3504f3u; // from sqrt(1/2) on
    const float e = float(int(bits) >> 23);
    const float m = uintBitsToFloat((bits & 0x7fffffu) + 0x3f3504f3u) - 1.0;
    float s = 7.0376836292e-2;
    s = s * m - 1.1514610310e-1;
    s = s * m + 1.1676998740e-1;
    s = s * m - 1.2420140846e-1;
    s = s * m + 1.4249322787e-1;
    s = s * m - 1.6668057665e-1;
    s = s * m + 2.0000714765e-1;
    s = s * m - 2.4999993993e-1;
    s = s * m + 3.3333331174e-1;
    const float z = m * m;
    return e * 0.693359375 + (m + (s * m * z - 2.12194440e-4 * e - 0.5 * z));
}
