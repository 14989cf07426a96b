// The check of a platform on six cables that meet in pairs, by hand: sixteen transitions from rest a vector, threads
// along the transitions. The mathematics are those of families/platforms/from_rest_lanes.py and robots/statics/wrench_lanes.py.
#include "vectors.h"
typedef Lanes Triple[3];

static inline void crossed(const Lanes *a, const Lanes *b, Lanes *c) {
    for (int i = 0; i < 3; i++) c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}
static inline Lanes dotted(const Lanes *a, const Lanes *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static inline Lanes weighted(const float *w, const Lanes *x) { return w[0] * x[0] + w[1] * x[1] + w[2] * x[2]; }

// segments: 11 rows of n (reach 3, axis 3, I e / m 3, angle in half turns, beta-hat). table: (samples, 11) of rest_lanes.
// base: (6, 3); points: (3, 3), cable k hangs on point joint[k]; depth of p0, gravity. found: (n), smallest tension per
// mass and length; far below zero where the determinant has not the sign it has at rest.
extern "C" void six_cables(const float *segments, const float *table, const float *base, const float *points,
                           const int *joint, float depth, float gravity, size_t n, int samples, float *found) {
    const float rate = gravity / depth;
#pragma omp parallel for schedule(static)
    for (size_t at = 0; at < n; at += WIDTH) {
        Lanes f[11], lowest = every(1e30f);
        for (int k = 0; k < 11; k++) f[k] = *(const Lanes *)(segments + k * n + at);
        const Lanes *reach = f, *axis = f + 3, *own = f + 6, angle = f[9], h = f[10];
        for (int i = 0; i < samples; i++) {
            const float *row = table + i * 11;
            Lanes sine, cosine;
            sincospi(angle * (row[2] + h * (row[3] + row[4])), &sine, &cosine);
            const Lanes speed = angle * (row[5] + h * (row[6] + row[7])), squared = rate * speed * speed;
            const Lanes spin = rate * angle * (row[8] + h * (row[9] + row[10])), part = 1.0f - cosine;
            Triple turn[3], arm[3], force, weight, whirl, moment, pull[6], torque[6];
            for (int r = 0; r < 3; r++)
                for (int c = 0; c < 3; c++) {
                    turn[r][c] = part * axis[r] * axis[c];
                    if (r == c) turn[r][c] += cosine;
                    else turn[r][c] += (c == (r + 2) % 3 ? sine : -sine) * axis[3 - r - c];
                }
            for (int r = 0; r < 3; r++) {
                force[r] = rate * row[1] * reach[r] - (r == 2 ? gravity : 0.0f);
                weight[r] = dotted(turn[r], own);
                for (int j = 0; j < 3; j++) arm[j][r] = weighted(points + 3 * j, turn[r]);
            }
            crossed(axis, weight, whirl);
            for (int r = 0; r < 3; r++) moment[r] = spin * weight[r] + squared * whirl[r];
            for (int k = 0; k < 6; k++) {
                for (int r = 0; r < 3; r++)
                    pull[k][r] = base[3 * k + r] - (r == 2 ? depth : 0.0f) - row[0] * reach[r] - arm[joint[k]][r];
                crossed(arm[joint[k]], pull[k], torque[k]);
            }
            Triple side[3], g[3], top, e[3], rest, inner[3], odd;
            for (int j = 0; j < 3; j++) crossed(pull[(2 * j + 2) % 6], pull[(2 * j + 4) % 6], side[j]);
            const Lanes d = dotted(pull[0], side[0]);
            for (int j = 0; j < 3; j++) {
                top[j] = dotted(side[j], force);
                for (int c = 0; c < 3; c++) g[j][c] = dotted(side[j], pull[2 * c + 1]);
            }
            for (int r = 0; r < 3; r++) {
                rest[r] = d * moment[r];
                for (int j = 0; j < 3; j++) rest[r] -= torque[2 * j][r] * top[j];
                for (int c = 0; c < 3; c++) {
                    e[c][r] = d * torque[2 * c + 1][r];
                    for (int j = 0; j < 3; j++) e[c][r] -= torque[2 * j][r] * g[j][c];
                }
            }
            for (int j = 0; j < 3; j++) crossed(e[(j + 1) % 3], e[(j + 2) % 3], inner[j]);
            const Lanes determinant = dotted(e[0], inner[0]), whole = d * determinant, share = 1.0f / whole;
            Lanes least = every(1e30f);
            for (int j = 0; j < 3; j++) odd[j] = dotted(inner[j], rest), least = smaller(least, d * odd[j] * share);
            for (int j = 0; j < 3; j++) least = smaller(least, (top[j] * determinant - dotted(g[j], odd)) * share);
            lowest = smaller(lowest, determinant > 0.0f ? least : every(-1e30f));
        }
        *(Lanes *)(found + at) = lowest;
    }
}
