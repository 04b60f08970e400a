// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// one Jacobi rotation that zeroes a_pq of a symmetric 3x3 matrix, r being the third index; Golub and Van Loan 8.4
void jacobi_rotate(inout float pp, inout float qq, inout float pq, inout float rp, inout float rq, inout vec3 v_p, inout vec3 v_q)
{
    if (abs(pq) < 1e-30)
        return;
    const float theta = (qq - pp) / (2.0 * pq);
    const float t = (theta < 0.0 ? -1.0 : 1.0) / (abs(theta) + sqrt(theta * theta + 1.0));
    const float c = inversesqrt(t * t + 1.0), s = t * c;
    pp -= t * pq;
    qq += t * pq;
    pq = 0.0;
    const float old_rp = rp;
    rp = c * old_rp - s * rq;
    rq = s * old_rp + c * rq;
    const vec3 old_p = v_p;
    v_p = c * old_p - s * v_q;
    v_q = s * old_p + c * v_q;
}

void order_pair(inout float a, inout float b, inout vec3 v_a, inout vec3 v_b)
{
    const bool swap = b < a;
    const float low = swap ? b : a;
    const vec3 v_low = swap ? v_b : v_a;
    b = swap ? a : b;
    v_b = swap ? v_a : v_b;
    a = low;
    v_a = v_low;
}

// eigenvalues, ascending, and unit eigenvectors (columns) of the symmetric matrix [diagonal; xy, xz, yz], whose trace is
// about 1: five sweeps, after which fp32 has nothing left to gain
void eigen_symmetric3(vec3 diagonal, float xy, float xz, float yz, out vec3 values, out mat3 vectors)
{
    vec3 v0 = vec3(1, 0, 0), v1 = vec3(0, 1, 0), v2 = vec3(0, 0, 1);
    float xx = diagonal.x, yy = diagonal.y, zz = diagonal.z;
    [[unroll]] for (uint sweep = 0; sweep < 5; ++sweep) {
        jacobi_rotate(xx, yy, xy, xz, yz, v0, v1);
        jacobi_rotate(xx, zz, xz, xy, yz, v0, v2);
        jacobi_rotate(yy, zz, yz, xy, xz, v1, v2);
    }
    order_pair(xx, yy, v0, v1);
    order_pair(yy, zz, v1, v2);
    order_pair(xx, yy, v0, v1);
    values = vec3(xx, yy, zz);
    vectors = mat3(normalize(v0), normalize(v1), normalize(v2));
}
