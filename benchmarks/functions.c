/* The yardstick of functions: sines of an array by hand, eight in a vector, and by the C library, one by one; and a
 * pendulum whose force is the C library's sine.
 *
 * sines_by_hand reduces by three fused multiplications (Cody & Waite), good for |x| < 1e5, and evaluates both polynomials
 * of degree 13 and 14: errors of about one unit in the last place, no care for infinities or for arguments near
 * multiples of pi.
 *
 * Built by benchmarks/functions.py with: cc -O3 -march=native -mprefer-vector-width=512 -fno-math-errno -shared -fPIC
 */
#include <math.h>

typedef double lanes __attribute__((vector_size(64)));
typedef long long words __attribute__((vector_size(64)));
typedef double stored __attribute__((vector_size(64), aligned(8), may_alias));

#ifdef __AVX512F__
#include <immintrin.h>
static inline lanes fused(lanes a, lanes b, lanes c) { return (lanes)_mm512_fmadd_pd((__m512d)a, (__m512d)b, (__m512d)c); }
static inline lanes where_odd(words q, lanes yes, lanes no) {
    return (lanes)_mm512_mask_mov_pd((__m512d)no, _mm512_test_epi64_mask((__m512i)q, _mm512_set1_epi64(1)), (__m512d)yes);
}
#else
static inline lanes where_odd(words q, lanes yes, lanes no) {
    words mask = -(q & 1);
    return (lanes)(((words)yes & mask) | ((words)no & ~mask));
}
static inline __attribute__((always_inline)) lanes fused(lanes a, lanes b, lanes c) {
    lanes r;
    for (int i = 0; i < 8; i++) r[i] = __builtin_fma(a[i], b[i], c[i]);
    return r;
}
#endif

static inline lanes all(double x) { return (lanes){x, x, x, x, x, x, x, x}; }

void sines_by_hand(const double *x, long rows, long count, double *y, long results, long length) {
    const lanes rounder = all(0x1.8p52);
    for (long i = 0; i < count; i += 8) {
        lanes a = *(const stored *)(x + i);
        lanes shifted = fused(a, all(0.6366197723675814), rounder);
        words quarters = (words)shifted;
        lanes n = shifted - rounder;
        lanes r = fused(n, all(-1.5707963267948966), a);
        r = fused(n, all(-6.123233995736766e-17), r);
        lanes z = r * r;
        lanes s = fused(z, all(1.5918095236696272e-10), all(-2.5051131372218632e-08));
        s = fused(s, z, all(2.7557316100283695e-06));
        s = fused(s, z, all(-0.000198412698367542));
        s = fused(s, z, all(0.008333333333330946));
        s = fused(s, z, all(-0.16666666666666666));
        s = fused(r * z, s, r);
        lanes c = fused(z, all(-1.1383e-11), all(2.08757008419747316778e-09));
        c = fused(c, z, all(-2.75573141792967388112e-07));
        c = fused(c, z, all(2.48015872888517045348e-05));
        c = fused(c, z, all(-1.38888888888730564116e-03));
        c = fused(c, z, all(4.16666666666665929218e-02));
        c = fused(z * z, c, fused(z, all(-0.5), all(1.0)));
        lanes value = where_odd(quarters, c, s);
        *(stored *)(y + i) = (lanes)((words)value ^ ((quarters & 2) << 62));
    }
}

void sines_by_library(const double *x, long rows, long count, double *y, long results, long length) {
    for (long i = 0; i < count; i++) y[i] = sin(x[i]);
}

/* Kahan-compensated steps of a drift-first method; rows: position, its carry, momentum, its carry. */
void pendulum(long count, int stages, const double *drifts, const double *kicks, double *rows) {
    double q = rows[0], eq = rows[1], p = rows[2], ep = rows[3];
#define UPDATE(y, carry, c, f)                             \
    do {                                                   \
        double increment_ = __builtin_fma((c), (f), carry); \
        double total_ = (y) + increment_;                  \
        carry = increment_ + ((y) - total_);               \
        y = total_;                                        \
    } while (0)
    for (long i = 0; i < count; i++) {
        for (int k = 0; k < stages; k++) {
            UPDATE(q, eq, drifts[k], p);
            UPDATE(p, ep, kicks[k], sin(q));
        }
        UPDATE(q, eq, drifts[stages], p);
    }
    rows[0] = q, rows[1] = eq, rows[2] = p, rows[3] = ep;
}

/* Call a compiled loop over arrays many times: a call from Python costs as much as thousand numbers. */
void repeated(void (*loop)(const double *, long, long, double *, long, long), const double *x, long rows, long count,
              double *y, long results, long times) {
    for (long i = 0; i < times; i++) loop(x, rows, count, y, results, count);
}
