// The check of a point mass on three cables, by hand: sixteen segments a vector, threads along the segments.
// The mathematics are those of cspr_jax/maps/sieve.py: an upper bound of the margin before rounding is allowed for.
#include "vectors.h"

// segments: 15 rows of n (start radius, span, precession in half turns, sense, tilt 2, pull 3 x 2, twist 3).
// table: for each number of arcs cosine, sine, A, A'', A'' cosine, A' sine at the samples. found: (numbers, n).
extern "C" void three_cables(const float *segments, const float *table, const float *arcs, const float *tau,
                             size_t n, int numbers, int samples, float *found) {
    const float pi = 3.14159265f;
#pragma omp parallel for schedule(static)
    for (size_t at = 0; at < n; at += WIDTH) {
        Lanes f[15], lateral[64], axial[64];
        for (int k = 0; k < 15; k++) f[k] = *(const Lanes *)(segments + k * n + at);
        const Lanes start = f[0], span = f[1], precession = f[2], sense = f[3];
        const Lanes tilt0 = f[4], tilt1 = f[5] * sense;
        Lanes pull0[3], pull1[3], twist[3];
        for (int k = 0; k < 3; k++) pull0[k] = f[6 + 2 * k], pull1[k] = f[7 + 2 * k] * sense, twist[k] = f[12 + k] * sense;
        for (int i = 0; i < samples; i++) sincospi(precession * tau[i], &lateral[i], &axial[i]);
        for (int j = 0; j < numbers; j++) {
            const float p = arcs[j], *row = table + (size_t)j * 6 * samples;
            const Lanes ratio = precession / p, period = (pi * p) * (pi * p) * (1.0f - ratio) * (1.0f + ratio);
            const Lanes bend = span / (period > 1e-9f ? period : every(1.0f)), growth = span * (2.0f / (pi * p));
            Lanes lowest = every(1e30f);
            for (int i = 0; i < samples; i++) {
                const float cosine = row[i], sine = row[samples + i], size = row[2 * samples + i], a2 = row[3 * samples + i];
                const float a2_cosine = row[4 * samples + i], a1_sine = row[5 * samples + i];
                const Lanes r = start + span * size, small = ratio * sine;
                const Lanes c_r = r * cosine, c_t = small * r;
                const Lanes d_r = bend * a2_cosine - growth * a1_sine, d_t = small * (bend * a2 + 2.0f * r);
                const Lanes c0 = axial[i] * c_r + lateral[i] * c_t, c1 = axial[i] * c_t - lateral[i] * c_r;
                const Lanes d0 = axial[i] * d_r + lateral[i] * d_t, d1 = axial[i] * d_t - lateral[i] * d_r;
                const Lanes cross = c_r * d_t - c_t * d_r, eta = 1.0f + tilt0 * c0 + tilt1 * c1;
                Lanes least = Lanes{};
                for (int k = 0; k < 3; k++) least = smaller(least, pull0[k] * d0 + pull1[k] * d1 + twist[k] * cross);
                lowest = smaller(lowest, eta + least);
            }
            *(Lanes *)(found + (size_t)j * n + at) = period > 1e-9f ? lowest : every(-1e30f);
        }
    }
}
