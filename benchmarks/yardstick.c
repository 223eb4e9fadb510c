/* The yardstick: what a C compiler makes of the same method, without any energy.
 *
 * Each function integrates `count` steps of a drift-first method with `stages` stages, WIDTH trajectories side by side.
 * rows: d positions, d carries, d momenta, d carries, each WIDTH doubles. Two forms, each plain and Kahan-compensated:
 *
 * as_written: drift by drift and kick by kick, as a user writes it. `drifts` and `kicks`: step size times coefficient, the
 *   kicks negated, one double a stage (the same step size in every lane).
 * looking_ahead: the kernels' own form, operation by operation. `moves`: stages + 2 rows of kick, drift, their product, and
 *   what the product as rounded leaves out; the first move, that of later steps, the others, and the one that ends a step.
 *
 * Built by benchmarks/kernels.py with: cc -O3 -march=native -mprefer-vector-width=512 -fno-math-errno -shared -fPIC
 */
#include <math.h>

typedef double lanes1;
typedef double lanes8 __attribute__((vector_size(64)));
/* As they lie in memory: rows are aligned to doubles only. */
typedef double stored1;
typedef double stored8 __attribute__((vector_size(64), aligned(8), may_alias));

static inline lanes1 fma_1(lanes1 a, lanes1 b, lanes1 c) { return __builtin_fma(a, b, c); }
static inline lanes1 root_1(lanes1 a) { return __builtin_sqrt(a); }

#ifdef __AVX512F__
#include <immintrin.h>
static inline __attribute__((always_inline)) lanes8 fma_8(lanes8 a, lanes8 b, lanes8 c) {
    return (lanes8)_mm512_fmadd_pd((__m512d)a, (__m512d)b, (__m512d)c);
}
static inline __attribute__((always_inline)) lanes8 root_8(lanes8 a) { return (lanes8)_mm512_sqrt_pd((__m512d)a); }
#else
static inline __attribute__((always_inline)) lanes8 fma_8(lanes8 a, lanes8 b, lanes8 c) {
    lanes8 r;
    for (int i = 0; i < 8; i++) r[i] = __builtin_fma(a[i], b[i], c[i]);
    return r;
}
static inline __attribute__((always_inline)) lanes8 root_8(lanes8 a) {
    lanes8 r;
    for (int i = 0; i < 8; i++) r[i] = __builtin_sqrt(a[i]);
    return r;
}
#endif

#define FORCE_sho(W) f[0][v] = q[0][v];

#define FORCE_henon_heiles(W)                                              \
    lanes##W x = q[0][v], y = q[1][v];                                     \
    f[0][v] = fma_##W(x, y + y, x);                                        \
    f[1][v] = fma_##W(-y, y, fma_##W(x, x, y));

#define FORCE_kepler(W)                                                    \
    lanes##W x = q[0][v], y = q[1][v];                                     \
    lanes##W square = fma_##W(x, x, y * y);                                \
    lanes##W pull = gravity / (square * square) * root_##W(square);        \
    f[0][v] = pull * x;                                                    \
    f[1][v] = pull * y;

#define UPDATE_plain(W, y, carry, c, f) y = fma_##W((c), (f), y)

#define UPDATE_compensated(W, y, carry, c, f)             \
    do {                                                  \
        lanes##W increment_ = fma_##W((c), (f), carry);   \
        lanes##W total_ = (y) + increment_;               \
        carry = increment_ + ((y) - total_);              \
        y = total_;                                       \
    } while (0)

#define MOVE_plain(W)                                                                        \
    do {                                                                                     \
        q[k][v] = fma_##W(product, f[k][v], fma_##W(drift, p[k][v], q[k][v]));               \
        p[k][v] = fma_##W(kick, f[k][v], p[k][v]);                                           \
    } while (0)

#define MOVE_compensated(W)                                                                  \
    do {                                                                                     \
        lanes##W ahead = fma_##W(drift, p[k][v], late[k][v]) + eq[k][v];                     \
        UPDATE_compensated(W, q[k][v], ahead, product, f[k][v]);                             \
        eq[k][v] = ahead;                                                                    \
        late[k][v] = rest * f[k][v];                                                         \
        UPDATE_compensated(W, p[k][v], ep[k][v], kick, f[k][v]);                             \
    } while (0)

#define EACH(D, V) for (int k = 0; k < D; k++) for (int v = 0; v < V; v++)
#define PLACE(W, V, row) (rows + ((row) * V + v) * W)

#define LOAD(D, W, V)                                                                        \
    lanes##W q[D][V], p[D][V], eq[D][V], ep[D][V], f[D][V];                                  \
    const lanes##W gravity = (lanes##W){0} + 1.71994752;                                     \
    (void)gravity;                                                                           \
    EACH(D, V) {                                                                             \
        q[k][v] = *(const stored##W *)PLACE(W, V, k);                                        \
        eq[k][v] = *(const stored##W *)PLACE(W, V, D + k);                                   \
        p[k][v] = *(const stored##W *)PLACE(W, V, 2 * D + k);                                \
        ep[k][v] = *(const stored##W *)PLACE(W, V, 3 * D + k);                               \
        f[k][v] = (lanes##W){0};                                                             \
    }

#define STORE(D, W, V)                                                                       \
    EACH(D, V) {                                                                             \
        *(stored##W *)PLACE(W, V, k) = q[k][v];                                              \
        *(stored##W *)PLACE(W, V, D + k) = eq[k][v];                                         \
        *(stored##W *)PLACE(W, V, 2 * D + k) = p[k][v];                                      \
        *(stored##W *)PLACE(W, V, 3 * D + k) = ep[k][v];                                     \
    }

#define ROW(W, i)                                                                                              \
    const lanes##W kick = (lanes##W){0} + moves[4 * (i)], drift = (lanes##W){0} + moves[4 * (i) + 1];          \
    const lanes##W product = (lanes##W){0} + moves[4 * (i) + 2], rest = (lanes##W){0} + moves[4 * (i) + 3];    \
    (void)rest;

/* V registers of W lanes. */
#define KERNEL(SYSTEM, D, W, V, WIDTH, SUM)                                                                    \
    void SYSTEM##_##WIDTH##_##SUM##_as_written(long count, int stages, const double *drifts,                   \
                                               const double *kicks, double *rows) {                            \
        LOAD(D, W, V)                                                                                          \
        for (long n = 0; n < count; n++) {                                                                     \
            for (int i = 0; i < stages; i++) {                                                                 \
                const lanes##W c = (lanes##W){0} + drifts[i], d = (lanes##W){0} + kicks[i];                    \
                EACH(D, V) UPDATE_##SUM(W, q[k][v], eq[k][v], c, p[k][v]);                                     \
                for (int v = 0; v < V; v++) { FORCE_##SYSTEM(W); }                                             \
                EACH(D, V) UPDATE_##SUM(W, p[k][v], ep[k][v], d, f[k][v]);                                     \
            }                                                                                                  \
            const lanes##W c = (lanes##W){0} + drifts[stages];                                                 \
            EACH(D, V) UPDATE_##SUM(W, q[k][v], eq[k][v], c, p[k][v]);                                         \
        }                                                                                                      \
        STORE(D, W, V)                                                                                         \
    }                                                                                                          \
    void SYSTEM##_##WIDTH##_##SUM##_looking_ahead(long count, int stages, const double *moves, double *rows) { \
        LOAD(D, W, V)                                                                                          \
        lanes##W late[D][V];                                                                                   \
        EACH(D, V) late[k][v] = (lanes##W){0};                                                                 \
        for (long n = 0; n < count; n++)                                                                       \
            for (int i = 0; i < stages; i++) {                                                                 \
                ROW(W, i ? i + 1 : n > 0)                                                                      \
                EACH(D, V) MOVE_##SUM(W);                                                                      \
                for (int v = 0; v < V; v++) { FORCE_##SYSTEM(W); }                                             \
            }                                                                                                  \
        ROW(W, stages + 1)                                                                                     \
        EACH(D, V) {                                                                                           \
            MOVE_##SUM(W);                                                                                     \
            eq[k][v] = eq[k][v] + late[k][v];                                                                  \
        }                                                                                                      \
        STORE(D, W, V)                                                                                         \
    }

#define KERNELS(SYSTEM, D)                   \
    KERNEL(SYSTEM, D, 1, 1, 1, plain)        \
    KERNEL(SYSTEM, D, 1, 1, 1, compensated)  \
    KERNEL(SYSTEM, D, 8, 1, 8, plain)        \
    KERNEL(SYSTEM, D, 8, 1, 8, compensated)  \
    KERNEL(SYSTEM, D, 8, 2, 16, plain)       \
    KERNEL(SYSTEM, D, 8, 2, 16, compensated) \
    KERNEL(SYSTEM, D, 8, 4, 32, plain)       \
    KERNEL(SYSTEM, D, 8, 4, 32, compensated)

KERNELS(sho, 1)
KERNELS(henon_heiles, 2)
KERNELS(kepler, 2)
