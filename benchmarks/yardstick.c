/* The yardstick: what a C compiler makes of the same step, Kahan-compensated, without any energy.
 *
 * Each function integrates `count` steps of a drift-first method with `stages` stages, WIDTH trajectories side by side in
 * one vector. rows: d positions, d carries, d momenta, d carries, each WIDTH doubles. drifts and kicks: step size times
 * coefficient, the kicks negated, one double a stage (the same step size in every lane).
 *
 * Built by benchmarks/kernels.py with: cc -O3 -march=native -mprefer-vector-width=512 -fno-math-errno -shared -fPIC
 */
#include <math.h>

typedef double lanes1;
typedef double lanes8 __attribute__((vector_size(64)));
/* As they lie in memory: rows are aligned to doubles only. */
typedef double stored1;
typedef double stored8 __attribute__((vector_size(64), aligned(8), may_alias));

#define UPDATE(TYPE, y, carry, c, f)                  \
    do {                                              \
        TYPE increment_ = FMA_##TYPE((c), (f), carry); \
        TYPE total_ = (y) + increment_;               \
        carry = increment_ + ((y) - total_);          \
        y = total_;                                   \
    } while (0)

static inline lanes1 FMA_lanes1(lanes1 a, lanes1 b, lanes1 c) { return __builtin_fma(a, b, c); }
static inline lanes1 ROOT_lanes1(lanes1 a) { return __builtin_sqrt(a); }

#define VECTOR(TYPE, WIDTH)                                                                   \
    static inline __attribute__((always_inline)) TYPE FMA_##TYPE(TYPE a, TYPE b, TYPE c) {    \
        TYPE r;                                                                               \
        for (int i = 0; i < WIDTH; i++) r[i] = __builtin_fma(a[i], b[i], c[i]);               \
        return r;                                                                             \
    }                                                                                         \
    static inline __attribute__((always_inline)) TYPE ROOT_##TYPE(TYPE a) {                   \
        TYPE r;                                                                               \
        for (int i = 0; i < WIDTH; i++) r[i] = __builtin_sqrt(a[i]);                          \
        return r;                                                                             \
    }

#ifdef __AVX512F__
#include <immintrin.h>
static inline __attribute__((always_inline)) lanes8 FMA_lanes8(lanes8 a, lanes8 b, lanes8 c) {
    return (lanes8)_mm512_fmadd_pd((__m512d)a, (__m512d)b, (__m512d)c);
}
static inline __attribute__((always_inline)) lanes8 ROOT_lanes8(lanes8 a) { return (lanes8)_mm512_sqrt_pd((__m512d)a); }
#else
VECTOR(lanes8, 8)
#endif

#define FORCE_sho(TYPE) \
    TYPE fx = q[0];

#define FORCE_henon_heiles(TYPE)                                       \
    TYPE x = q[0], y = q[1];                                           \
    TYPE fx = FMA_##TYPE(x, y + y, x);                                 \
    TYPE fy = FMA_##TYPE(-y, y, FMA_##TYPE(x, x, y));

#define FORCE_kepler(TYPE)                                             \
    TYPE x = q[0], y = q[1];                                           \
    TYPE square = FMA_##TYPE(x, x, y * y);                             \
    TYPE pull = gravity / (square * ROOT_##TYPE(square));              \
    TYPE fx = pull * x, fy = pull * y;

#define KERNEL(SYSTEM, D, TYPE, WIDTH)                                                                            \
    void SYSTEM##_##WIDTH(long count, int stages, const double *drifts, const double *kicks, double *rows) {      \
        TYPE q[D], p[D], eq[D], ep[D];                                                                            \
        const TYPE gravity = (TYPE){0} + 1.71994752;                                                              \
        (void)gravity;                                                                                            \
        for (int k = 0; k < D; k++) {                                                                             \
            q[k] = *(const stored##WIDTH *)(rows + k * WIDTH);                                                    \
            eq[k] = *(const stored##WIDTH *)(rows + (D + k) * WIDTH);                                             \
            p[k] = *(const stored##WIDTH *)(rows + (2 * D + k) * WIDTH);                                          \
            ep[k] = *(const stored##WIDTH *)(rows + (3 * D + k) * WIDTH);                                         \
        }                                                                                                         \
        for (long n = 0; n < count; n++) {                                                                        \
            for (int i = 0; i < stages; i++) {                                                                    \
                const TYPE c = (TYPE){0} + drifts[i], d = (TYPE){0} + kicks[i];                                   \
                for (int k = 0; k < D; k++) UPDATE(TYPE, q[k], eq[k], c, p[k]);                                   \
                FORCE_##SYSTEM(TYPE);                                                                             \
                UPDATE(TYPE, p[0], ep[0], d, fx);                                                                 \
                SECOND_##D(TYPE);                                                                                 \
            }                                                                                                     \
            const TYPE c = (TYPE){0} + drifts[stages];                                                            \
            for (int k = 0; k < D; k++) UPDATE(TYPE, q[k], eq[k], c, p[k]);                                       \
        }                                                                                                         \
        for (int k = 0; k < D; k++) {                                                                             \
            *(stored##WIDTH *)(rows + k * WIDTH) = q[k];                                                          \
            *(stored##WIDTH *)(rows + (D + k) * WIDTH) = eq[k];                                                   \
            *(stored##WIDTH *)(rows + (2 * D + k) * WIDTH) = p[k];                                                \
            *(stored##WIDTH *)(rows + (3 * D + k) * WIDTH) = ep[k];                                               \
        }                                                                                                         \
    }

#define SECOND_1(TYPE)
#define SECOND_2(TYPE) UPDATE(TYPE, p[1], ep[1], d, fy)

KERNEL(sho, 1, lanes1, 1)
KERNEL(henon_heiles, 2, lanes1, 1)
KERNEL(kepler, 2, lanes1, 1)
KERNEL(sho, 1, lanes8, 8)
KERNEL(henon_heiles, 2, lanes8, 8)
KERNEL(kepler, 2, lanes8, 8)
