// Vectors of sixteen numbers, and the sine and cosine of half turns for them.
#pragma once
#include <stddef.h>
typedef float Lanes __attribute__((vector_size(64)));
typedef int Integers __attribute__((vector_size(64)));
enum { WIDTH = 16 };

static inline Lanes every(float x) { return x - Lanes{}; }
static inline Lanes smaller(Lanes a, Lanes b) { return a < b ? a : b; }

// sin(pi x) and cos(pi x): x less the nearest integer, by polynomials; the parity of that integer is the sign.
static inline void sincospi(Lanes x, Lanes *sine, Lanes *cosine) {
    Lanes shifted = x + 12582912.0f;
    Integers sign = (Integers)shifted << 31;
    Lanes y = (x - (shifted - 12582912.0f)) * 3.14159265f, q = y * y;
    Lanes s = y * (1.0f + q * (-1.6666667e-1f + q * (8.3333333e-3f + q * (-1.9841270e-4f + q * (2.7557319e-6f - q * 2.5052108e-8f)))));
    Lanes c = 1.0f + q * (-0.5f + q * (4.1666667e-2f + q * (-1.3888889e-3f + q * (2.4801587e-5f + q * (-2.7557319e-7f + q * 2.0876757e-9f)))));
    *sine = (Lanes)((Integers)s ^ sign);
    *cosine = (Lanes)((Integers)c ^ sign);
}
