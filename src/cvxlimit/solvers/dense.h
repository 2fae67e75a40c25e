/* Products and Cholesky factors of dense panels, stored column by column. */

#include "arguments.h"

#define QUADS 3    /* of LANES rows, and columns of the tile that a processor's registers hold */
#define TALL (QUADS * LANES)
#define BROAD 4
#define DEEP 256   /* columns of a product that are packed at a time, */
#define THICK 64   /* and the least that pay */
#define BLOCK 64   /* columns of a panel that are updated together; within, as many as a tile has */

/* sums (LANES quads, broad) := A B', in registers; reads up to whole lanes of rows. */
INLINE void tile(const int quads, const int broad, Py_ssize_t k, const double *A, Py_ssize_t lda,
                 const double *B, Py_ssize_t ldb, double *sums) {
    Lanes s[BROAD][QUADS] = {{SPREAD(0.0)}};
    for (Py_ssize_t p = 0; p < k; p++) {
        const Lanes *a = (const Lanes *)(A + p * lda);
        const double *b = B + p * ldb;
UNROLLED(4)
        for (int q = 0; q < broad; q++) {
            Lanes share = SPREAD(b[q]);
UNROLLED(3)
            for (int t = 0; t < quads; t++) s[q][t] += a[t] * share;
        }
    }
UNROLLED(4)
    for (int q = 0; q < broad; q++)
UNROLLED(3)
        for (int t = 0; t < quads; t++) *(Lanes *)(sums + q * TALL + LANES * t) = s[q][t];
}

#define TILE(quads, broad) case 4 * quads + broad: tile(quads, broad, k, A, lda, B, ldb, sums); break

WIDE static void tiled(Py_ssize_t tall, Py_ssize_t broad, Py_ssize_t k, const double *A, Py_ssize_t lda,
                       const double *B, Py_ssize_t ldb, double *sums) {
    switch (4 * ((tall + LANES - 1) / LANES) + broad) {
        TILE(1, 1); TILE(1, 2); TILE(1, 3); TILE(1, 4);
        TILE(2, 1); TILE(2, 2); TILE(2, 3); TILE(2, 4);
        TILE(3, 1); TILE(3, 2); TILE(3, 3); TILE(3, 4);
    }
}

typedef enum { SET, ADD, SUBTRACT } Mode;

INLINE void put(const double *sums, Py_ssize_t tall, Py_ssize_t broad, double *C, Py_ssize_t ldc, Mode mode) {
    for (Py_ssize_t q = 0; q < broad; q++)
        for (Py_ssize_t t = 0; t < tall; t++) {
            double *c = C + t + q * ldc, sum = sums[q * TALL + t];
            *c = mode == SET ? sum : mode == ADD ? *c + sum : *c - sum;
        }
}

/* The same as multiplied, of operands that are copied to the order in which they are used: columns of
 * tall panels lie on a page of memory each. ``room`` is for DEEP (n + BROAD + TALL) numbers. */
WIDE static void packed(Py_ssize_t m, Py_ssize_t n, Py_ssize_t k, const double *A, Py_ssize_t lda,
                        const double *B, Py_ssize_t ldb, double *C, Py_ssize_t ldc, Mode mode, double *room) {
    double sums[BROAD * TALL], *rows = room, *columns = room + DEEP * TALL;
    for (Py_ssize_t from = 0; from < k; from += DEEP, A += DEEP * lda, B += DEEP * ldb) {
        Py_ssize_t deep = k - from < DEEP ? k - from : DEEP;
        for (Py_ssize_t j = 0; j < n; j += BROAD)
            for (Py_ssize_t p = 0; p < deep; p++)
                for (Py_ssize_t q = 0; q < BROAD; q++)
                    columns[j * deep + p * BROAD + q] = j + q < n ? B[j + q + p * ldb] : 0.0;
        for (Py_ssize_t i = 0; i < m; i += TALL) {
            Py_ssize_t tall = m - i < TALL ? m - i : TALL;
            for (Py_ssize_t p = 0; p < deep; p++)
                for (Py_ssize_t t = 0; t < TALL; t++) rows[p * TALL + t] = t < tall ? A[i + t + p * lda] : 0.0;
            for (Py_ssize_t j = 0; j < n && j < i + TALL; j += BROAD) {
                Py_ssize_t broad = n - j < BROAD ? n - j : BROAD;
                tiled(tall, broad, deep, rows, TALL, columns + j * deep, BROAD, sums);
                put(sums, tall, broad, C + i + j * ldc, ldc, from && mode == SET ? ADD : mode);
            }
        }
    }
}

/* The lower half of C (m, n) = or -= A (m, k) B' for B (n, k), all stored column by column. */
WIDE static void multiplied(Py_ssize_t m, Py_ssize_t n, Py_ssize_t k, const double *A, Py_ssize_t lda,
                            const double *B, Py_ssize_t ldb, double *C, Py_ssize_t ldc, Mode mode,
                            double *room) {
    double sums[BROAD * TALL];
    if (k >= THICK && n >= THICK) {
        packed(m, n, k, A, lda, B, ldb, C, ldc, mode, room);
        return;
    }
    for (Py_ssize_t j = 0; j < n; j += BROAD) {
        Py_ssize_t broad = n - j < BROAD ? n - j : BROAD;
        for (Py_ssize_t i = j / TALL * TALL; i < m; i += TALL) { /* what lies above is not needed */
            Py_ssize_t tall = m - i < TALL ? m - i : TALL;
            tiled(tall, broad, k, A + i, lda, B + j, ldb, sums);
            put(sums, tall, broad, C + i + j * ldc, ldc, mode);
        }
    }
}

/* A panel (height, width), whose updates have been made, in place; 0 if a pivot is not positive. Its
 * columns are ``ld`` numbers apart. */
WIDE static int eliminated(Py_ssize_t height, Py_ssize_t width, double *L, Py_ssize_t ld, double *room) {
    for (Py_ssize_t at = 0; at < width; at += BROAD) {
        Py_ssize_t block = at / BLOCK * BLOCK, end = at + BROAD < width ? at + BROAD : width;
        Py_ssize_t last = block + BLOCK < width ? block + BLOCK : width;
        double *to = L + at + at * ld, *before = L + at + block * ld;
        if (at == block && at) /* by all blocks before */
            multiplied(height - at, last - at, at, L + at, ld, L + at, ld, to, ld, SUBTRACT, room);
        if (at > block)
            multiplied(height - at, end - at, at - block, before, ld, before, ld, to, ld, SUBTRACT, room);
        for (Py_ssize_t j = at; j < end; j++) {
            double *own = L + j * ld;
            for (Py_ssize_t k = at; k < j; k++) {
                const double *earlier = L + k * ld;
                double share = earlier[j];
                for (Py_ssize_t i = j; i < height; i++) own[i] -= share * earlier[i];
            }
            if (!(own[j] > 0.0)) return 0;
            double root = sqrt(own[j]), inverse = 1.0 / root;
            own[j] = root;
            for (Py_ssize_t i = j + 1; i < height; i++) own[i] *= inverse;
        }
    }
    return 1;
}
