/* Infeasible-start interior point for  min c'x  subject to  E x = f,  G x + s = h,  s in K, whose variables
 * fall into small blocks that no row of G joins: contacts, or copies of them.
 *
 * Nesterov-Todd scaling; Mehrotra's predictor and corrector; further correctors after J. Gondzio, Multiple
 * centrality corrections, 1996. After the first full step every iterate satisfies its equations to far less
 * than its gap and is strictly inside the cones, so that its bounds lose nothing but the gap. Formulas of
 * cones: L. Vandenberghe, The CVXOPT linear and quadratic cone program solvers, 2010, 2 and 4.
 *
 * Every block's variables are eliminated by a factor of its own; what is left is a matrix with a row per
 * equation, six per masonry block, which sparse.h factorises: in the order given, or by neighbourhood
 * (E. Cuthill, J. McKee, 1969). A few variables may be in no cone at all, as a load factor is, or in many
 * equations: they border it. Rows of G and columns come block by block. */

#include <stdio.h>

#include "sparse.h"

/* ---- the numbers of the method ---- */

/* What counts as a small block. */
#define BORDER 20        /* most variables in no cone or in more equations than these: */
#define DENSE 24         /* a square of so many would fill in what is left */
#define WIDEST 128       /* most variables of a block */

/* Steps: the share of the way to the boundary; of Gondzio's correctors so many at most, the longer step
 * aimed at, the band for the products around the target, the share of the aim that makes another one worth
 * it, and the step beyond which none is. The target is the share NEAREST of the mean product at least.
 * Where rounding leaves a point outside, steps are shortened by RETREAT, down to the SHORTEST. */
#define REACH 0.99
#define CORRECTORS 2
#define WIDEN 0.3
#define BAND 0.03
#define GAIN 0.1
#define LONG_STEP 0.9
#define NEAREST 1e-8
#define RETREAT 0.8
#define SHORTEST 1e-6

/* The end: the worst gap and residual called solved and almost; where a wide gap is asked for, residuals may
 * be the share BALANCE of it. Near it, for gaps below LATE, relative to objectives of the LEAST_VALUE or
 * more, the iteration stops after PATIENCE iterations without a gain of a factor 2. NO_ANSWER is the
 * residual of a proof that there is no optimum. */
#define SOLVED 1e-8
#define ALMOST 1e-4
#define BALANCE 1e-5
#define LATE 1e-10
#define LEAST_VALUE 1e-6
#define PATIENCE 5
#define NO_ANSWER 1e-9

/* Starts: the relative gap of the first point from which the next problem may start; a start is moved inside
 * by that share of its mean entries which it misses of the problem, SHIFT at most; a cold one has
 * eigenvalues no less than COLD times the mean of the other unknowns of its side. */
#define MIDDLE 1e-2
#define SHIFT 0.1
#define COLD 0.1

/* Directions are refined until what they leave costs the bounds the share LIGHT of the gap that the next
 * point may have at best, AHEAD of this one's or the one asked for, or is below the target, relative to its
 * own right-hand side or the share FLOOR of the largest: the TARGET, or WIDER times the gap asked for, the
 * LOOSEST at most, which gives the same brackets in three fifths of the eliminations; in so many ROUNDS at
 * most, and until one gains less than the factor SLOW. Plain steps are kept up while they gain the factor
 * FAST. The best point is chosen at THIN times the costs of equilibrium: they are those of typical loads, and
 * where corners are about to open 16 to 140 times as much was lost. */
#define LIGHT 1e-3
#define AHEAD 0.1
#define TARGET 1e-6
#define WIDER 300.0
#define LOOSEST 1e-3
#define FLOOR 1e-8
#define ROUNDS 6
#define SLOW 0.9
#define FAST 0.1
#define THIN 50.0

/* Rounding: what is added to diagonals, relatively. Blocks whose squares have a pivot below HARD, or less
 * where the target is wider, are eliminated by reflections, none of whose pivots is below the share SOFTEST
 * of its column: softer ones cost equilibrium more than they bring the flow rule. Refinement takes these
 * effects out again. */
#define MORE 1e-14
#define HARD 1e-6
#define SOFTEST 1e-9

/* Memory. */
#define SAID 160         /* letters of a refusal */
#define ROOMS 160
#define MOST_KEPT (64 << 20) /* bytes that one run leaves to the next */

typedef enum { UNSUITED, WAS_SOLVED, WAS_ALMOST, STALLED, INFEASIBLE, UNBOUNDED } Status;

typedef struct {
    Py_ssize_t from, to;           /* columns, */
    Py_ssize_t line, lines;        /* linear rows, */
    Py_ssize_t cone, cones;        /* second-order cones, */
    Py_ssize_t equation, equations; /* equations, as places in ``touched``, */
    double *root, *product;        /* L and L' (c, c) of the block's G' W^-2 G, with 1 / L_ii between, and L^-1 E' (c, wide) */
    Py_ssize_t wide;               /* e, rounded up to whole lanes */
    int opens, closes;             /* the first and the last of several blocks with the same equations */
    Py_ssize_t *slot;              /* where the last one's products go: of pairs (0, 0), (1, 0) ... (1, 1) ... */
    Py_ssize_t *order;             /* of columns, where reflections have chosen another */
} Block;

typedef struct {
    Py_ssize_t n, p, m, lines, cones, bound, degree; /* ``bound`` columns are in blocks, others the border */
    Py_ssize_t blocks;
    int are_triples;               /* all cones have three rows */
    Block *block;
    Py_ssize_t *column, *row;      /* where columns and rows of G were in the program given, */
    Py_ssize_t *equation;          /* where equations were */
    Factor *factor;                /* of what is left of them, */
    Py_ssize_t *diagonal, *slots;  /* its diagonal's places, and those of blocks */
    Py_ssize_t outer[BORDER][2];  /* linear rows of columns of the border: the first, how many */
    Py_ssize_t *start, *index;     /* G by rows */
    double *value;
    Py_ssize_t *estart, *eindex, *elocal; /* E by columns, and where in the block's equations an entry is */
    double *evalue, *square;
    Py_ssize_t *touched, *place;   /* equations of blocks; where cones start among the rows */
    double *c, *f, *h;
    Py_ssize_t *orders;
    double target, hard;           /* of refinement; pivots below it are left to reflections */
    double *border, *corner, *part; /* part is a block's scaled rows */
    double *line, *inverse, *w, *sizes, *lam; /* scaling: of linear rows W and W^-1, frames and sizes of cones */
    double *reciprocal;            /* 1 / lam; of cones over the root of its determinant, and what steps divide by */
    double *half;
    double unit, loads;
    char *store;                   /* where rooms are, as far as it suffices: its size, how much is used, */
    size_t stored, used, wanted;   /* and how much would be */
    char said[SAID];               /* why a program does not suit */
    void *memory[ROOMS];           /* the other rooms */
    int rooms;
} Program;

typedef struct {
    double *x, *y, *z, *s;
} Point;

typedef struct {
    double mu, gap, infeasibility, score, dual, allowed_x, allowed_y;
} Measure;

INLINE double larger(double a, double b) { return a > b ? a : b; }

INLINE void swap(double *a, double *b) {
    double kept = *a;
    *a = *b, *b = kept;
}

INLINE double smaller(double a, double b) { return a < b ? a : b; }

INLINE double most_of(const double *v, Py_ssize_t n) { /* of numbers: NaN may be passed over */
    double most[4] = {0.0, 0.0, 0.0, 0.0};
    for (Py_ssize_t i = 0; i < n; i++) most[i % 4] = larger(most[i % 4], fabs(v[i]));
    return larger(larger(most[0], most[1]), larger(most[2], most[3]));
}

INLINE double dot(const double *u, const double *v, Py_ssize_t n) { /* of few */
    double sum = 0.0;
    for (Py_ssize_t i = 0; i < n; i++) sum += u[i] * v[i];
    return sum;
}

WIDE static double long_dot(const double *u, const double *v, Py_ssize_t n) {
    Lanes first = SPREAD(0.0), second = SPREAD(0.0);
    Py_ssize_t i = 0;
    for (; i + 2 * LANES <= n; i += 2 * LANES) {
        first += *(const Lanes *)(u + i) * *(const Lanes *)(v + i);
        second += *(const Lanes *)(u + i + LANES) * *(const Lanes *)(v + i + LANES);
    }
    first += second;
    return TOTAL(first) + dot(u + i, v + i, n - i);
}

INLINE int is_finite(const double *v, Py_ssize_t n) { return isfinite(long_dot(v, v, n)); }

/* Twice, for most programs' cones all have three rows, which compilers are to know. */
#define EACH_CONE(k, at, d, ...) \
    if (g->are_triples) \
        for (Py_ssize_t k = 0, at = g->lines; k < g->cones; k++, at += 3) { const Py_ssize_t d = 3; __VA_ARGS__ } \
    else \
        for (Py_ssize_t k = 0; k < g->cones; k++) { \
            const Py_ssize_t at = g->place[k], d = g->place[k + 1] - at; \
            __VA_ARGS__ \
        }

INLINE double determinant(const double *u, Py_ssize_t d) {
    double norm = sqrt(dot(u + 1, u + 1, d - 1));
    return (u[0] - norm) * (u[0] + norm);
}

WIDE static double margin(const Program *g, const double *u) {
    double least = INFINITY;
    for (Py_ssize_t i = 0; i < g->lines; i++)
        least = smaller(least, u[i]);
    EACH_CONE(k, at, d,
        double own = u[at] - sqrt(dot(u + at + 1, u + at + 1, d - 1));
        least = smaller(least, own);
    )
    return least;
}

/* The longest step from lam along v. */
WIDE static double step(const Program *g, const double *v) {
    double most[4] = {0.0, 0.0, 0.0, 0.0}, worst = 0.0;
    for (Py_ssize_t i = 0; i < g->lines; i++) {
        most[i % 4] = larger(most[i % 4], -v[i] * g->reciprocal[i]);
    }
    EACH_CONE(k, at, d,
        const double *a = g->lam + at, *b = v + at;
        double root = g->reciprocal[at], along = b[0] * root;
        double first = (a[0] * b[0] - dot(a + 1, b + 1, d - 1)) * root * root;
        double share = (first + along) * g->reciprocal[at + 1], sum = 0.0;
        for (Py_ssize_t i = 1; i < d; i++) {
            double off = (b[i] - share * a[i]) * root;
            sum += off * off;
        }
        worst = larger(worst, sqrt(sum) - first);
    )
    for (int t = 0; t < 4; t++) worst = larger(worst, most[t]);
    return worst > 0.0 ? 1.0 / worst : worst == 0.0 ? INFINITY : 0.0;
}

WIDE static int scaled(const Program *g, const double *s, const double *z) {
    if (!(margin(g, s) > 0.0 && margin(g, z) > 0.0)) return 0;
    for (Py_ssize_t i = 0; i < g->lines; i++) {
        double root = sqrt(s[i] * z[i]), reciprocal = 1.0 / root;
        g->lam[i] = root, g->reciprocal[i] = reciprocal;
        g->line[i] = s[i] * reciprocal, g->inverse[i] = z[i] * reciprocal;
    }
    EACH_CONE(k, at, d,
        const double *a = s + at, *b = z + at;
        double *w = g->w + at, ds = sqrt(determinant(a, d)), dz = sqrt(determinant(b, d)), sum = 0.0;
        double unit = sqrt(2.0 * (1.0 + dot(a, b, d) / ds / dz));
        for (Py_ssize_t i = 1; i < d; i++) {
            w[i] = (a[i] / ds - b[i] / dz) / unit;
            sum += w[i] * w[i];
        }
        w[0] = sqrt(1.0 + sum);
        g->sizes[k] = sqrt(ds / dz);
        double cross = dot(w + 1, b + 1, d - 1), share = b[0] + cross / (1.0 + w[0]);
        g->lam[at] = g->sizes[k] * (w[0] * b[0] + cross);
        for (Py_ssize_t i = 1; i < d; i++) g->lam[at + i] = g->sizes[k] * (b[i] + share * w[i]);
        double root = sqrt(determinant(g->lam + at, d));
        g->reciprocal[at] = 1.0 / root, g->reciprocal[at + 1] = 1.0 / (1.0 + g->lam[at] / root);
    )
    return 1;
}

/* W v (sign 1) or W^-1 v (sign -1). */
WIDE static void times(const Program *g, const double *v, double sign, double *out) {
    const double *line = sign > 0.0 ? g->line : g->inverse;
    for (Py_ssize_t i = 0; i < g->lines; i++) out[i] = v[i] * line[i];
    EACH_CONE(k, at, d,
        const double *w = g->w + at;
        double scale = sign > 0.0 ? g->sizes[k] : 1.0 / g->sizes[k], first = v[at];
        double cross = sign * dot(w + 1, v + at + 1, d - 1), share = sign * (first + cross / (1.0 + w[0]));
        out[at] = scale * (w[0] * first + cross);
        for (Py_ssize_t i = 1; i < d; i++) out[at + i] = scale * (v[at + i] + share * w[i]);
    )
}

WIDE static void product(const Program *g, const double *u, const double *v, double *out) {
    for (Py_ssize_t i = 0; i < g->lines; i++) out[i] = u[i] * v[i];
    EACH_CONE(k, at, d,
        double first = dot(u + at, v + at, d), a = u[at], b = v[at];
        for (Py_ssize_t i = 1; i < d; i++) out[at + i] = a * v[at + i] + b * u[at + i];
        out[at] = first;
    )
}

/* out with lam o out = v. */
WIDE static void over_lam(const Program *g, const double *v, double *out) {
    for (Py_ssize_t i = 0; i < g->lines; i++) out[i] = v[i] * g->reciprocal[i];
    EACH_CONE(k, at, d,
        const double *u = g->lam + at;
        double first = (u[0] * v[at] - dot(u + 1, v + at + 1, d - 1)) * g->reciprocal[at] * g->reciprocal[at];
        for (Py_ssize_t i = 1; i < d; i++) out[at + i] = (v[at + i] - first * u[i]) / u[0];
        out[at] = first;
    )
}

INLINE double clip(double v, double low, double high) { return v < low ? low : v > high ? high : v; }

/* aim += what moves the products' eigenvalues into [low, high]. */
WIDE static void towards(const Program *g, const double *products, double low, double high, double *aim) {
    for (Py_ssize_t i = 0; i < g->lines; i++)
        aim[i] += larger(clip(products[i], low, high) - products[i], -high);
    EACH_CONE(k, at, d,
        const double *u = products + at;
        double norm = sqrt(dot(u + 1, u + 1, d - 1));
        double most = clip(u[0] + norm, low, high), least = clip(u[0] - norm, low, high);
        double share = 0.5 * (most - least) / (norm > 0.0 ? norm : 1.0);
        aim[at] += larger(0.5 * (most + least) - u[0], -high);
        for (Py_ssize_t i = 1; i < d; i++) aim[at + i] += larger(share * u[i] - u[i], -high);
    )
}

WIDE static void by_rows(const Program *g, const double *x, double *out) { /* G x */
    for (Py_ssize_t i = 0; i < g->m; i++) {
        double sum = 0.0;
        for (Py_ssize_t k = g->start[i]; k < g->start[i + 1]; k++) sum += g->value[k] * x[g->index[k]];
        out[i] = sum;
    }
}

WIDE static void add_by_columns(const Program *g, const double *v, double *out) { /* + G' v */
    for (Py_ssize_t i = 0; i < g->m; i++)
        for (Py_ssize_t k = g->start[i]; k < g->start[i + 1]; k++) out[g->index[k]] += g->value[k] * v[i];
}

WIDE static void equations_of(const Program *g, const double *x, double *out) { /* E x */
    memset(out, 0, sizeof(double) * g->p);
    for (Py_ssize_t j = 0; j < g->n; j++)
        for (Py_ssize_t k = g->estart[j]; k < g->estart[j + 1]; k++) out[g->eindex[k]] += g->evalue[k] * x[j];
}

WIDE static void add_equations(const Program *g, const double *y, double *out) { /* + E' y */
    for (Py_ssize_t j = 0; j < g->n; j++)
        for (Py_ssize_t k = g->estart[j]; k < g->estart[j + 1]; k++) out[j] += g->evalue[k] * y[g->eindex[k]];
}

/* P := L^-1 P, whose square is added; rows of P are so many ``quads`` of LANES. */
INLINE void squared(const Block *b, const Py_ssize_t quads, double *P, double *square) {
    Py_ssize_t c = b->to - b->from, e = b->equations, wide = LANES * quads;
    const double *L = b->root;
    for (Py_ssize_t i = 0; i < c; i++) {
        Lanes *own = (Lanes *)(P + i * wide);
        for (Py_ssize_t j = 0; j < i; j++) {
            const Lanes *before = (const Lanes *)(P + j * wide);
            double share = L[i * c + j];
            if (share == 0.0) continue;
            Lanes shares = SPREAD(share);
            for (Py_ssize_t k = 0; k < quads; k++) own[k] -= shares * before[k];
        }
        double inverse = L[i * c + i];
        Lanes inverses = SPREAD(inverse);
        for (Py_ssize_t k = 0; k < quads; k++) own[k] *= inverses;
    }
    if (b->opens) memset(square, 0, sizeof(double) * e * wide);
    for (Py_ssize_t i = 0; i < c; i++) {
        const Lanes *own = (const Lanes *)(P + i * wide);
        for (Py_ssize_t k = 0; k < e; k++) {
            double share = P[i * wide + k];
            if (share == 0.0) continue;
            Lanes shares = SPREAD(share), *to = (Lanes *)(square + k * wide);
            for (Py_ssize_t l = k / LANES; l < quads; l++) to[l] += shares * own[l];
        }
    }
}

/* rows (d, c) := W^-1 G of one cone. */
INLINE void scaled_rows(const Program *g, const Block *b, Py_ssize_t number, double *rows) {
    Py_ssize_t c = b->to - b->from, from = g->place[number], d = g->place[number + 1] - from;
    const double *w = g->w + from;
    double scale = 1.0 / g->sizes[number], cross[WIDEST];
    memset(cross, 0, sizeof(double) * c);
    for (Py_ssize_t i = 0; i < d; i++) {
        double *own = rows + i * c;
        memset(own, 0, sizeof(double) * c);
        for (Py_ssize_t k = g->start[from + i]; k < g->start[from + i + 1]; k++)
            own[g->index[k] - b->from] += g->value[k];
        if (i) for (Py_ssize_t j = 0; j < c; j++) cross[j] += w[i] * own[j];
    }
    for (Py_ssize_t i = d - 1; i >= 0; i--) {
        double *own = rows + i * c;
        for (Py_ssize_t j = 0; j < c; j++)
            own[j] = scale * (i ? own[j] + (cross[j] / (1.0 + w[0]) - rows[j]) * w[i] : w[0] * own[j] - cross[j]);
    }
}

/* L by Householder reflections of the scaled rows themselves, whose squares rounding would not tell apart
 * once it spoils the openings. The largest column and row that are left come first: rows differ by all
 * that lies between open and pressed corners (A. J. Cox, N. J. Higham, Stability of Householder QR
 * factorization for weighted least squares problems, 1998). */
static void reflected(const Program *g, Block *b) {
    Py_ssize_t c = b->to - b->from, r = b->lines, *order = b->order = g->orders + b->from;
    double *left = g->part, *L = b->root, least[WIDEST];
    memset(left, 0, sizeof(double) * r * c);
    for (Py_ssize_t i = 0; i < r; i++)
        for (Py_ssize_t k = g->start[b->line + i]; k < g->start[b->line + i + 1]; k++)
            left[i * c + g->index[k] - b->from] += g->value[k] * g->inverse[b->line + i];
    for (Py_ssize_t number = b->cone; number < b->cone + b->cones; number++) {
        scaled_rows(g, b, number, left + r * c);
        r += g->place[number + 1] - g->place[number];
    }
    for (Py_ssize_t j = 0; j < c; j++) {
        double sum = 0.0;
        for (Py_ssize_t m = 0; m < r; m++) sum += left[m * c + j] * left[m * c + j];
        least[j] = SOFTEST * sqrt(sum), order[j] = j;
    }
    for (Py_ssize_t i = 0; i < c; i++) {
        Py_ssize_t column = i, row = i, other = order[i];
        double most = -1.0, pivot = 0.0;
        for (Py_ssize_t j = i; j < c; j++) {
            double sum = 0.0;
            for (Py_ssize_t m = i; m < r; m++) sum += left[m * c + j] * left[m * c + j];
            if (sum > most) most = sum, column = j;
        }
        order[i] = order[column], order[column] = other;
        for (Py_ssize_t m = 0; m < r; m++) swap(left + m * c + i, left + m * c + column);
        for (Py_ssize_t m = i; m < r; m++)
            if (fabs(left[m * c + i]) > fabs(left[row * c + i])) row = m;
        for (Py_ssize_t j = 0; j < c; j++) swap(left + i * c + j, left + row * c + j);
        for (Py_ssize_t m = i; m < r; m++) pivot += left[m * c + i] * left[m * c + i];
        pivot = -copysign(larger(sqrt(pivot), least[order[i]]), left[i * c + i]);
        left[i * c + i] -= pivot;
        for (Py_ssize_t j = i + 1; j < c; j++) {
            double share = 0.0;
            for (Py_ssize_t m = i; m < r; m++) share += left[m * c + i] * left[m * c + j];
            share /= pivot * left[i * c + i];
            for (Py_ssize_t m = i; m < r; m++) left[m * c + j] += share * left[m * c + i];
        }
        L[i * c + i] = 1.0 / pivot;
        for (Py_ssize_t j = 0; j < i; j++) L[i * c + j] = L[j * c + i] = left[j * c + i];
    }
}

/* L of the block's G' W^-2 G, and L^-1 E', whose square is added to the Schur complement. */
WIDE static void eliminated_block(const Program *g, Block *b) {
    Py_ssize_t c = b->to - b->from, e = b->equations;
    double H[WIDEST * WIDEST], diagonal[WIDEST], reciprocal[WIDEST];
    double *L = b->root, *P = b->product, *rows = g->part;
    memset(H, 0, sizeof(double) * c * c);
    for (Py_ssize_t i = b->line; i < b->line + b->lines; i++) {
        double weight = g->inverse[i] * g->inverse[i];
        for (Py_ssize_t k = g->start[i]; k < g->start[i + 1]; k++) {
            double own = weight * g->value[k], *to = H + (g->index[k] - b->from) * c;
            for (Py_ssize_t l = g->start[i]; l < g->start[i + 1]; l++) to[g->index[l] - b->from] += own * g->value[l];
        }
    }
    for (Py_ssize_t number = b->cone; number < b->cone + b->cones; number++) {
        scaled_rows(g, b, number, rows);
        for (Py_ssize_t i = 0; i < g->place[number + 1] - g->place[number]; i++)
            for (Py_ssize_t j = 0; j < c; j++) {
                double own = rows[i * c + j], *to = H + j * c;
                if (own != 0.0)
                    for (Py_ssize_t l = j; l < c; l++) to[l] += own * rows[i * c + l];
            }
    }
    int is_hard = 0;
    for (Py_ssize_t i = 0; i < c; i++) diagonal[i] = H[i * c + i];
    for (Py_ssize_t j = 0; j < c && !is_hard; j++) {
        double *own = H + j * c, pivot = own[j], inverse = reciprocal[j] = 1.0 / pivot;
        is_hard = !(pivot > g->hard * diagonal[j]); /* NaN, too */
        for (Py_ssize_t i = j + 1; i < c; i++) {
            double share = own[i] * inverse, *to = H + i * c;
            for (Py_ssize_t l = i; l < c; l++) to[l] -= share * own[l];
        }
    }
    b->order = NULL;
    if (is_hard) reflected(g, b);
    else for (Py_ssize_t j = 0; j < c; j++) { /* roots at the end: there they need not wait for one another */
        double root = L[j * c + j] = sqrt(reciprocal[j]);
        for (Py_ssize_t l = j + 1; l < c; l++) L[l * c + j] = L[j * c + l] = H[j * c + l] * root;
    }
    memset(P, 0, sizeof(double) * c * b->wide);
    for (Py_ssize_t j = 0; j < c; j++) {
        Py_ssize_t from = b->from + (b->order ? b->order[j] : j);
        for (Py_ssize_t k = g->estart[from]; k < g->estart[from + 1]; k++)
            P[j * b->wide + g->elocal[k]] += g->evalue[k];
    }
    switch (b->wide / LANES) { /* compilers unroll what has a known length */
        case 1: squared(b, 1, P, g->square); break;
        case 2: squared(b, 2, P, g->square); break;
        case 3: squared(b, 3, P, g->square); break;
        default: squared(b, b->wide / LANES, P, g->square);
    }
    const Py_ssize_t *slot = b->slot;
    if (b->closes)
        for (Py_ssize_t k = 0; k < e; k++)
            for (Py_ssize_t l = k; l < e; l++) g->factor->values[*slot++] += g->square[k * b->wide + l];
}

static int factorised(const Program *g) {
    Py_ssize_t p = g->p;
    emptied(g->factor);
    for (Py_ssize_t i = 0; i < g->blocks; i++) eliminated_block(g, g->block + i);
    for (Py_ssize_t i = 0; i < p; i++) {
        double *own = g->factor->values + g->diagonal[i];
        *own = *own > 0.0 ? *own * (1.0 + MORE) : 1.0;
    }
    if (!numeric(g->factor)) return 0;
    for (Py_ssize_t i = 0; i < g->n - g->bound; i++) { /* half of what the border becomes: its square is the corner */
        double *own = g->border + i * p;
        Py_ssize_t j = g->bound + i;
        memset(own, 0, sizeof(double) * p);
        for (Py_ssize_t l = g->estart[j]; l < g->estart[j + 1]; l++) own[g->eindex[l]] = g->evalue[l];
        forward(g->factor, own);
        for (Py_ssize_t l = 0; l <= i; l++) {
            double sum = long_dot(own, g->border + l * p, p), *L = g->corner + i * BORDER;
            for (Py_ssize_t r = g->outer[i][0]; l == i && r < g->outer[i][0] + g->outer[i][1]; r++) {
                double entry = 0.0;
                for (Py_ssize_t t = g->start[r]; t < g->start[r + 1]; t++) entry += g->value[t] * g->inverse[r];
                sum += entry * entry;
            }
            for (Py_ssize_t t = 0; t < l; t++) sum -= L[t] * g->corner[l * BORDER + t];
            if (l == i && !(sum > 0.0)) return 0;
            L[l] = l == i ? sqrt(sum) : sum / g->corner[l * BORDER + l];
        }
    }
    return 1;
}

/* x (n,) and y (p,) of [G' W^-2 G, E'; E, 0] (x, y) = (rx, ry), by elimination. */
WIDE static void halved(const Program *g, const double *rx, const double *ry, double *x, double *y) {
    Py_ssize_t p = g->p;
    double *t = g->half, share[BORDER];
    for (Py_ssize_t i = 0; i < p; i++) y[i] = -ry[i];
    for (Py_ssize_t i = 0; i < g->blocks; i++) {
        const Block *b = g->block + i;
        Py_ssize_t c = b->to - b->from, e = b->equations;
        const Py_ssize_t *at = g->touched + b->equation;
        double *own = t + b->from, *sum = g->square;
        if (b->opens) memset(sum, 0, sizeof(double) * b->wide);
        if (b->order)
            for (Py_ssize_t j = 0; j < c; j++) own[j] = rx[b->from + b->order[j]];
        else memcpy(own, rx + b->from, sizeof(double) * c);
        for (Py_ssize_t j = 0; j < c; j++) {
            const double *after = b->root + j * c;
            double value = own[j] *= after[j];
            for (Py_ssize_t l = j + 1; l < c; l++) own[l] -= after[l] * value;
            const Lanes *P = (const Lanes *)(b->product + j * b->wide);
            Lanes values = SPREAD(value);
            for (Py_ssize_t k = 0; k < b->wide / LANES; k++) ((Lanes *)sum)[k] += values * P[k];
        }
        if (b->closes)
            for (Py_ssize_t k = 0; k < e; k++) y[at[k]] += sum[k];
    }
    forward(g->factor, y);
    for (Py_ssize_t i = 0; i < g->n - g->bound; i++) {
        double sum = rx[g->bound + i] - long_dot(g->border + i * p, y, p);
        for (Py_ssize_t l = 0; l < i; l++) sum -= g->corner[i * BORDER + l] * share[l];
        share[i] = sum / g->corner[i * BORDER + i];
    }
    for (Py_ssize_t i = g->n - g->bound - 1; i >= 0; i--) {
        for (Py_ssize_t l = i + 1; l < g->n - g->bound; l++) share[i] -= g->corner[l * BORDER + i] * share[l];
        share[i] /= g->corner[i * BORDER + i];
        const double *own = g->border + i * p;
        for (Py_ssize_t k = 0; k < p; k++) y[k] += share[i] * own[k];
        x[g->bound + i] = share[i];
    }
    backward(g->factor, y);
    for (Py_ssize_t i = 0; i < g->blocks; i++) {
        const Block *b = g->block + i;
        Py_ssize_t c = b->to - b->from, e = b->equations;
        const Py_ssize_t *at = g->touched + b->equation;
        double *own = t + b->from, *to = x + b->from, *beside = g->square;
        if (b->opens) {
            for (Py_ssize_t k = 0; k < e; k++) beside[k] = y[at[k]];
            for (Py_ssize_t k = e; k < b->wide; k++) beside[k] = 0.0;
        }
        for (Py_ssize_t j = 0; j < c; j++) {
            const Lanes *P = (const Lanes *)(b->product + j * b->wide);
            Lanes sums = SPREAD(0.0);
            for (Py_ssize_t k = 0; k < b->wide / LANES; k++) sums += P[k] * ((const Lanes *)beside)[k];
            own[j] -= TOTAL(sums);
        }
        for (Py_ssize_t j = c - 1; j >= 0; j--) {
            const double *before = b->root + j * c;
            double value = to[b->order ? b->order[j] : j] = own[j] * before[j];
            for (Py_ssize_t l = 0; l < j; l++) own[l] -= before[l] * value;
        }
    }
}

/* ---- iteration ---- */

typedef struct {
    double *own, *x, *y, *ds, *dz; /* changes of x and y, the scaled W^-1 ds and W dz that add up to own */
    double primal, dual;
} Direction;

/* Room for the iteration, all of it in one piece. */
typedef struct {
    double *rx, *ry, *rz, *rhs, *over, *aim, *a, *b, *v; /* over is W^-1 rz */
    double *left, *next, *changes; /* of refinement */
    Direction found, tried;
} Work;

static Measure measured(const Program *g, const Point *at, Work *w, double tolerance) {
    Measure r;
    for (Py_ssize_t j = 0; j < g->n; j++) w->rx[j] = 0.0;
    add_by_columns(g, at->z, w->rx);
    add_equations(g, at->y, w->rx);
    for (Py_ssize_t j = 0; j < g->n; j++) w->rx[j] = -(w->rx[j] + g->c[j]);
    equations_of(g, at->x, w->ry);
    for (Py_ssize_t i = 0; i < g->p; i++) w->ry[i] = g->f[i] - w->ry[i];
    by_rows(g, at->x, w->a);
    for (Py_ssize_t i = 0; i < g->m; i++) {
        w->a[i] = g->h[i] - w->a[i];
        w->rz[i] = w->a[i] - at->s[i];
    }
    double both = long_dot(at->s, at->z, g->m), primal = long_dot(g->c, at->x, g->n), size = larger(fabs(primal), LEAST_VALUE);
    double in_x = most_of(w->rx, g->n), in_y = most_of(w->ry, g->p), in_z = most_of(w->rz, g->m);
    double missing = in_x / larger(1.0, larger(most_of(at->z, g->m), most_of(at->y, g->p)));
    r.dual = -long_dot(g->f, at->y, g->p) - long_dot(g->h, at->z, g->m);
    r.gap = both / size;
    r.mu = both / g->degree;
    r.infeasibility = larger(larger(in_y, in_z) / larger(1.0, most_of(at->x, g->n)), missing);
    /* What the certificate may lose: above, it has to open contacts where rates break the flow rule, and loads do
     * work on that; below, forces have to be put into equilibrium again. */
    double cost = g->loads / size, outside = -margin(g, w->a);
    r.score = r.gap + larger(missing, in_x * cost) + THIN * (in_y + larger(outside, 0.0)) / g->unit;
    double share = LIGHT * larger(AHEAD * smaller(r.gap, 1.0), tolerance);
    r.allowed_x = share / cost, r.allowed_y = share * g->unit;
    return r;
}

static int is_within(const Program *g, const Measure *r, double tolerance, double residual) {
    double enough = residual > 0.0 ? residual : larger(SOLVED, BALANCE * tolerance);
    return r->gap < tolerance && r->infeasibility < enough;
}

/* A proof that there is no optimum; ``at`` becomes it. */
static Status no_answer(const Program *g, Point *at, const Measure *r, const Work *w) {
    if (r->dual > 0.0) {
        double most = 0.0;
        for (Py_ssize_t j = 0; j < g->n; j++) most = larger(most, fabs(w->rx[j] + g->c[j]));
        if (most < NO_ANSWER * r->dual) {
            for (Py_ssize_t i = 0; i < g->p; i++) at->y[i] /= r->dual;
            for (Py_ssize_t i = 0; i < g->m; i++) at->z[i] /= r->dual;
            return INFEASIBLE;
        }
    }
    double primal = long_dot(g->c, at->x, g->n), most = 0.0;
    if (primal < 0.0) {
        for (Py_ssize_t i = 0; i < g->p; i++) most = larger(most, fabs(g->f[i] - w->ry[i]));
        for (Py_ssize_t i = 0; i < g->m; i++) most = larger(most, fabs(g->h[i] - w->rz[i]));
        if (most < -NO_ANSWER * primal) {
            for (Py_ssize_t j = 0; j < g->n; j++) at->x[j] /= -primal;
            for (Py_ssize_t i = 0; i < g->m; i++) at->s[i] /= -primal;
            return UNBOUNDED;
        }
    }
    return UNSUITED;
}

static void lengths(const Program *g, Direction *d) {
    d->primal = smaller(1.0, REACH * step(g, d->ds));
    d->dual = smaller(1.0, REACH * step(g, d->dz));
}

static void directed(const Program *g, Work *w, Direction *d) { /* towards w->aim */
    over_lam(g, w->aim, d->own);
    for (Py_ssize_t i = 0; i < g->m; i++) w->b[i] = w->over[i] - d->own[i];
    times(g, w->b, -1.0, w->a);
    memcpy(w->rhs, w->rx, sizeof(double) * g->n);
    add_by_columns(g, w->a, w->rhs);
    halved(g, w->rhs, w->ry, d->x, d->y);
    by_rows(g, d->x, w->a);
    times(g, w->a, -1.0, w->b);
    for (Py_ssize_t i = 0; i < g->m; i++) {
        d->ds[i] = w->over[i] - w->b[i];
        d->dz[i] = d->own[i] - d->ds[i];
    }
    lengths(g, d);
}

static void exchanged(Work *w) {
    Direction other = w->found;
    w->found = w->tried, w->tried = other;
}

static double shorter(const Direction *d) { return smaller(d->primal, d->dual); }

/* The predictor and its correctors; the best is w->found. */
static void aimed(const Program *g, Work *w, const Measure *r) {
    Direction *d = &w->found;
    times(g, w->rz, -1.0, w->over);
    product(g, g->lam, g->lam, w->v);
    for (Py_ssize_t i = 0; i < g->m; i++) w->aim[i] = -w->v[i];
    directed(g, w, d);
    double ahead = 0.0;
    for (Py_ssize_t i = 0; i < g->m; i++)
        ahead += (g->lam[i] + d->primal * d->ds[i]) * (g->lam[i] + d->dual * d->dz[i]);
    double share = clip(ahead / g->degree / r->mu, 0.0, 1.0), goal = larger(share * share * share, NEAREST) * r->mu;
    product(g, d->ds, d->dz, w->a);
    for (Py_ssize_t i = 0; i < g->m; i++) w->aim[i] = -w->v[i] - w->a[i];
    for (Py_ssize_t i = 0; i < g->lines; i++) w->aim[i] += goal;
    for (Py_ssize_t k = 0; k < g->cones; k++) w->aim[g->place[k]] += goal;
    directed(g, w, d);
    for (int i = 0; i < CORRECTORS && shorter(d) <= LONG_STEP; i++) {
        double before = shorter(d), wider = smaller(1.0, before + WIDEN);
        for (Py_ssize_t j = 0; j < g->m; j++) {
            w->a[j] = g->lam[j] + wider * d->ds[j];
            w->b[j] = g->lam[j] + wider * d->dz[j];
        }
        product(g, w->a, w->b, w->v);
        towards(g, w->v, BAND * goal, goal / BAND, w->aim);
        directed(g, w, &w->tried);
        double now = shorter(&w->tried);
        if (now > before) exchanged(w);
        if (!(now >= before + GAIN * WIDEN)) break;
    }
}

/* The direction further along changes of x and y: what is left of the cones' equations is nothing. */
static void stepped(const Program *g, Work *w, const Direction *from, double share, const double *change,
                    Direction *to) {
    for (Py_ssize_t j = 0; j < g->n; j++) to->x[j] = from->x[j] + share * change[j];
    for (Py_ssize_t i = 0; i < g->p; i++) to->y[i] = from->y[i] + share * change[g->n + i];
    if (to != from) memcpy(to->own, from->own, sizeof(double) * g->m);
    by_rows(g, change, w->a); /* not the sum: rounding would be its, and refinement end there */
    times(g, w->a, -1.0, w->b);
    for (Py_ssize_t i = 0; i < g->m; i++) {
        to->ds[i] = from->ds[i] - share * w->b[i];
        to->dz[i] = from->dz[i] + share * w->b[i];
    }
}

/* What a direction leaves of the rates and of equilibrium, over their units; returns the largest. */
static double left_over(const Program *g, Work *w, const Direction *d, const double *unit, double *left) {
    double *rates = left, *forces = left + g->n;
    times(g, d->dz, -1.0, w->a);
    for (Py_ssize_t i = 0; i < g->m; i++) w->a[i] = -w->a[i];
    for (Py_ssize_t i = 0; i < g->p; i++) w->b[i] = -d->y[i];
    memcpy(rates, w->rx, sizeof(double) * g->n);
    add_by_columns(g, w->a, rates);
    add_equations(g, w->b, rates);
    equations_of(g, d->x, forces);
    for (Py_ssize_t j = 0; j < g->n; j++) rates[j] /= unit[0];
    for (Py_ssize_t i = 0; i < g->p; i++) forces[i] = (w->ry[i] - forces[i]) / unit[1];
    return most_of(left, g->n + g->p);
}

/* What elimination alone makes of them. */
static void eliminated_from(const Program *g, Work *w, const double *unit, const double *left, double *change) {
    for (Py_ssize_t j = 0; j < g->n; j++) w->rhs[j] = unit[0] * left[j];
    for (Py_ssize_t i = 0; i < g->p; i++) w->v[i] = unit[1] * left[g->n + i];
    halved(g, w->rhs, w->v, change, change + g->n);
}

/* The change that w->found stands for, improved by generalised conjugate residuals (S. C. Eisenstat, H. C.
 * Elman, M. H. Schultz, 1983) until what it leaves does no harm: rounding makes elimination wrong in a few
 * directions, which iterative refinement takes out slowly. */
static void refined(const Program *g, Work *w, const Measure *r, Point *change) {
    const Py_ssize_t size = g->n + g->p;
    double slack = 0.0, *left = w->left, *next = w->next;
    times(g, w->found.own, 1.0, w->a);
    for (Py_ssize_t i = 0; i < g->m; i++) slack = larger(slack, fabs(w->rz[i] - w->a[i]));
    double in_x = most_of(w->rx, g->n), in_y = most_of(w->ry, g->p), most = larger(larger(in_x, in_y), slack);
    double floor = FLOOR * (most > 0.0 ? most : 1.0);
    double unit[2] = {larger(g->target * larger(in_x, floor), r->allowed_x),
                      larger(g->target * larger(in_y, floor), r->allowed_y)};
    double error = left_over(g, w, &w->found, unit, left);
    int kept = 0;
    for (int round = 0; round < ROUNDS && error > 1.0; round++) {
        double *own = w->changes + 2 * kept * size, *effect = own + size;
        eliminated_from(g, w, unit, left, own);
        stepped(g, w, &w->found, 1.0, own, &w->tried);
        double now = left_over(g, w, &w->tried, unit, next);
        if (now < FAST * error) {
            exchanged(w), error = now;
            memcpy(left, next, sizeof(double) * size);
            continue;
        }
        for (Py_ssize_t i = 0; i < size; i++) effect[i] = left[i] - next[i];
        for (int k = 0; k < kept; k++) {
            const double *other = w->changes + 2 * k * size;
            double share = long_dot(effect, other + size, size);
            for (Py_ssize_t i = 0; i < 2 * size; i++) own[i] -= share * other[i];
        }
        double length = sqrt(long_dot(effect, effect, size));
        if (!(length > 0.0 && length < INFINITY)) break;
        for (Py_ssize_t i = 0; i < 2 * size; i++) own[i] /= length;
        double step = long_dot(effect, left, size);
        for (Py_ssize_t i = 0; i < size; i++) next[i] = left[i] - step * effect[i];
        now = most_of(next, size);
        if (!(now < SLOW * error)) break;
        stepped(g, w, &w->found, step, own, &w->found);
        memcpy(left, next, sizeof(double) * size);
        error = now, kept++;
    }
    if (kept) { /* only whole steps satisfy the equations to rounding */
        eliminated_from(g, w, unit, left, next);
        stepped(g, w, &w->found, 1.0, next, &w->tried);
        if (left_over(g, w, &w->tried, unit, left) < error) exchanged(w);
    }
    Direction *d = &w->found;
    lengths(g, d);
    memcpy(change->x, d->x, sizeof(double) * g->n);
    memcpy(change->y, d->y, sizeof(double) * g->p);
    times(g, d->dz, -1.0, change->z);
    times(g, d->ds, 1.0, change->s);
}

static void copied(const Program *g, const Point *from, Point *to) {
    memcpy(to->x, from->x, sizeof(double) * g->n), memcpy(to->y, from->y, sizeof(double) * g->p);
    memcpy(to->z, from->z, sizeof(double) * g->m), memcpy(to->s, from->s, sizeof(double) * g->m);
}

/* The point further along the change, strictly inside; 0 where rounding ends the iteration. */
static int moved(const Program *g, const Work *w, Point *at, const Point *change, Point *to) {
    double primal = w->found.primal, dual = w->found.dual;
    while (larger(primal, dual) > SHORTEST) {
        for (Py_ssize_t i = 0; i < g->m; i++) {
            to->z[i] = at->z[i] + dual * change->z[i];
            to->s[i] = at->s[i] + primal * change->s[i];
        }
        if (margin(g, to->z) > 0.0 && margin(g, to->s) > 0.0) {
            for (Py_ssize_t j = 0; j < g->n; j++) to->x[j] = at->x[j] + primal * change->x[j];
            for (Py_ssize_t i = 0; i < g->p; i++) to->y[i] = at->y[i] + dual * change->y[i];
            Point other = *at;
            *at = *to, *to = other;
            return 1;
        }
        primal *= RETREAT, dual *= RETREAT;
    }
    return 0;
}

static double mean_size(const double *v, Py_ssize_t n) {
    double sum = 0.0;
    for (Py_ssize_t i = 0; i < n; i++) sum += fabs(v[i]);
    return n ? sum / n : 0.0;
}

static void moved_inside(const Program *g, double *v, const double *beside, Py_ssize_t count) {
    double least = margin(g, v), size = larger(mean_size(v, g->m), COLD * mean_size(beside, count));
    if (!(size > 0.0)) size = 1.0;
    if (least > size) return;
    double more = larger(-2.0 * least, size);
    for (Py_ssize_t i = 0; i < g->lines; i++) v[i] += more;
    for (Py_ssize_t k = 0; k < g->cones; k++) v[g->place[k]] += more;
}

/* Least-squares solutions, moved inside the cones (Vandenberghe, section 7.3). */
static int cold(const Program *g, const Work *w, Point *at) {
    for (Py_ssize_t i = 0; i < g->m; i++) w->a[i] = i < g->lines ? 1.0 : 0.0;
    for (Py_ssize_t k = 0; k < g->cones; k++) w->a[g->place[k]] = 1.0;
    if (!scaled(g, w->a, w->a) || !factorised(g)) return 0;
    memset(w->rhs, 0, sizeof(double) * g->n);
    add_by_columns(g, g->h, w->rhs);
    halved(g, w->rhs, g->f, at->x, at->y);
    by_rows(g, at->x, w->a);
    for (Py_ssize_t i = 0; i < g->m; i++) at->s[i] = g->h[i] - w->a[i];
    for (Py_ssize_t j = 0; j < g->n; j++) w->rhs[j] = -g->c[j];
    memset(w->ry, 0, sizeof(double) * g->p);
    halved(g, w->rhs, w->ry, w->found.x, at->y);
    by_rows(g, w->found.x, at->z);
    moved_inside(g, at->s, at->x, g->n);
    moved_inside(g, at->z, at->y, g->p);
    return 1;
}

/* Between a point in the program's order, x, y, z and s in one array, and the blocks' order. */
static void taken(const Program *g, const double *given, Point *at) {
    const double *y = given + g->n, *z = y + g->p, *s = z + g->m;
    for (Py_ssize_t j = 0; j < g->n; j++) at->x[j] = given[g->column[j]];
    for (Py_ssize_t i = 0; i < g->p; i++) at->y[i] = y[g->equation[i]];
    for (Py_ssize_t i = 0; i < g->m; i++) at->z[i] = z[g->row[i]], at->s[i] = s[g->row[i]];
}

static void handed(const Program *g, const Point *at, double *to) {
    double *y = to + g->n, *z = y + g->p, *s = z + g->m;
    for (Py_ssize_t j = 0; j < g->n; j++) to[g->column[j]] = at->x[j];
    for (Py_ssize_t i = 0; i < g->p; i++) y[g->equation[i]] = at->y[i];
    for (Py_ssize_t i = 0; i < g->m; i++) z[g->row[i]] = at->z[i], s[g->row[i]] = at->s[i];
}

static double total(const double *v, Py_ssize_t n) { return n * mean_size(v, n); }

/* Residuals over what stands in their rows: rates by multipliers, loads, and slacks. */
static double missed(const Program *g, const Point *at, const Work *w) {
    double in_x = total(w->rx, g->n) / total(at->z, g->m), in_y = total(w->ry, g->p) / total(g->f, g->p);
    double in_z = total(w->rz, g->m) / total(at->s, g->m), most = 0.0;
    return larger(larger(larger(most, in_x), isfinite(in_y) ? in_y : 0.0), in_z);
}

/* The first of so many points given that misses no more of this problem than its gap, for the way from
 * others goes along the boundary, or the one that misses least for its gap; moved inside the cones. 0 if
 * none is of use. */
static int warm(const Program *g, const double *starts, Py_ssize_t count, Work *w, Point *at, Point *spare) {
    double least = INFINITY, share = 0.0;
    for (Py_ssize_t k = 0; k < count && least > 1.0; k++, starts += g->n + g->p + 2 * g->m) {
        if (!is_finite(starts, g->n + g->p + 2 * g->m)) continue;
        taken(g, starts, spare);
        Measure r = measured(g, spare, w, 1.0);
        double own = missed(g, spare, w);
        if (!(own < least * r.gap)) continue;
        Point other = *at;
        *at = *spare, *spare = other;
        least = own / r.gap, share = smaller(SHIFT, own);
    }
    double *sides[] = {at->z, at->s};
    for (int i = 0; i < 2; i++) {
        double more = share * mean_size(sides[i], g->m);
        for (Py_ssize_t j = 0; j < g->lines; j++) sides[i][j] += more;
        for (Py_ssize_t k = 0; k < g->cones; k++) sides[i][g->place[k]] += more;
        if (!(margin(g, sides[i]) > 0.0)) return 0;
    }
    return least < INFINITY;
}

/* What is asked, and what else than the best point is found. */
typedef struct {
    double tolerance, residual, enough;
    Py_ssize_t most, count;  /* iterations */
    const double *starts;
    Py_ssize_t given;        /* starts */
    double *way;             /* points on the way, of every power of ten of gaps and residuals the first, */
    int64_t *power;
    Py_ssize_t room, ways;   /* so many at most, and found */
} Run;

static Status minimised(const Program *g, Work *w, Point *at, Point *spare, Point *change, Point *best, Run *run) {
    double scores[PATIENCE], worst = INFINITY, rank = INFINITY, least = INFINITY;
    int is_solved = 0;
    const double enough = larger(SOLVED, run->tolerance);
    if (!(run->given && warm(g, run->starts, run->given, w, at, spare)) && !cold(g, w, at)) return UNSUITED;
    copied(g, at, best);
    for (Py_ssize_t count = 0;; run->count = ++count) {
        Measure r = measured(g, at, w, run->tolerance);
        int is_enough = is_within(g, &r, enough, run->residual);
        if (is_enough > is_solved || (is_enough == is_solved && r.score < rank)) {
            copied(g, at, best);
            is_solved = is_enough, rank = r.score;
        }
        least = smaller(least, r.score);
        worst = smaller(worst, larger(r.gap, r.infeasibility));
        int64_t power = count && worst < MIDDLE ? (int64_t)floor(log10(larger(worst, 1e-300))) : 0;
        if (power < (run->ways ? run->power[run->ways - 1] : 0) && run->ways < run->room) {
            handed(g, at, run->way + run->ways * (g->n + g->p + 2 * g->m));
            run->power[run->ways++] = power;
        }
        Status none = no_answer(g, at, &r, w);
        if (none != UNSUITED) {
            copied(g, at, best);
            return none;
        }
        int is_late = worst < SOLVED || r.gap < LATE;
        double before = count >= PATIENCE ? scores[count % PATIENCE] : INFINITY;
        scores[count % PATIENCE] = least;
        if (is_within(g, &r, run->tolerance, run->residual)) break;
        if (is_late && least > 0.5 * before && count >= PATIENCE) break;
        if (r.dual >= run->enough &&
            most_of(w->rx, g->n) * g->loads <= LIGHT * fabs(r.dual - run->enough)) {
            copied(g, at, best);
            return WAS_SOLVED;
        }
        if (count == run->most || !scaled(g, at->s, at->z)) break;
        if (!factorised(g)) break;
        aimed(g, w, &r);
        refined(g, w, &r, change);
        int is_good = is_finite(change->x, g->n) && is_finite(change->y, g->p) && is_finite(change->z, g->m) &&
                      is_finite(change->s, g->m);
        if (!is_good || !moved(g, w, at, change, spare)) break;
    }
    return is_solved ? WAS_SOLVED : worst < ALMOST ? WAS_ALMOST : STALLED;
}

/* ---- programs ---- */

/* A store that one run leaves to the next: new memory costs an eighth of the time. Only who holds the
 * interpreter's lock takes or leaves it. */
static struct { char *store; size_t stored; } left;

static void *room(Program *g, Py_ssize_t count, Py_ssize_t size) {
    size_t bytes = ((size_t)(count + 8) * size + 63) / 64 * 64; /* lanes may be read beyond */
    g->wanted += bytes;
    if (g->used + bytes <= g->stored) {
        g->used += bytes;
        return memset(g->store + g->used - bytes, 0, bytes);
    }
    void *found = g->rooms < ROOMS ? calloc(bytes, 1) : NULL;
    if (found) g->memory[g->rooms++] = found;
    return found;
}

static void opened(Program *g) {
    g->store = left.store, g->stored = left.stored;
    left.store = NULL, left.stored = 0;
}

static void closed(Program *g) {
    while (g->rooms) free(g->memory[--g->rooms]);
    if (g->factor) freed(g->factor);
    if (g->wanted > g->stored && g->wanted <= MOST_KEPT) {
        free(g->store);
        g->store = malloc(g->wanted), g->stored = g->store ? g->wanted : 0;
    }
    if (g->stored > left.stored) {
        char *other = left.store;
        left.store = g->store, left.stored = g->stored, g->store = other;
    }
    free(g->store);
}

static Py_ssize_t top(Py_ssize_t *parent, Py_ssize_t j) {
    while (parent[j] != j) j = parent[j] = parent[parent[j]];
    return j;
}

/* A program as CVXPY gives it: A by columns, rows of E before those of G. */
typedef struct {
    const double *c, *b, *data;
    const int32_t *indptr, *indices;
    const int64_t *soc, *order; /* of equations, or NULL */
    Py_ssize_t orders;
} Given;

#define ROOM(type, count) room(g, count, sizeof(type))
#define EACH_GIVEN(j, k) for (int32_t k = v->indptr[j]; k < v->indptr[j + 1]; k++)

#define REFUSED(...) do { snprintf(g->said, SAID, __VA_ARGS__); return 0; } while (0)

/* Which columns and rows belong to which block, in g->column, g->row and g->block: 1; 0 if they do not
 * suit, -1 without memory. */
static int grouped(Program *g, const Given *v) {
    Py_ssize_t n = g->n, p = g->p, units = g->lines + g->cones, border = 0, *rank;
    Py_ssize_t *parent = ROOM(Py_ssize_t, n), *first = ROOM(Py_ssize_t, units), *unit = ROOM(Py_ssize_t, g->m);
    Py_ssize_t *number = ROOM(Py_ssize_t, n), *size = ROOM(Py_ssize_t, n), *next = ROOM(Py_ssize_t, n + 1);
    g->column = ROOM(Py_ssize_t, n), g->row = ROOM(Py_ssize_t, g->m), rank = ROOM(Py_ssize_t, g->cones);
    g->place = ROOM(Py_ssize_t, g->cones + 1), g->block = ROOM(Block, n);
    if (!parent || !first || !unit || !number || !size || !next || !g->column || !g->row || !rank || !g->place ||
        !g->block) return -1;
    for (Py_ssize_t i = 0; i < g->lines; i++) unit[i] = i;
    for (Py_ssize_t k = 0, i = g->lines; k < g->cones; k++) {
        for (Py_ssize_t d = 0; d < v->soc[k]; d++) unit[i++] = g->lines + k;
    }
    for (Py_ssize_t i = 0; i < units; i++) first[i] = -1;
    for (Py_ssize_t j = 0; j < n; j++) parent[j] = j;
    for (Py_ssize_t j = 0; j < n; j++) EACH_GIVEN(j, k) if (v->indices[k] >= p) {
        Py_ssize_t own = unit[v->indices[k] - p];
        if (first[own] < 0) first[own] = j;
        else parent[top(parent, j)] = top(parent, first[own]);
    }
    if (!p) REFUSED("there are no equations");
    for (Py_ssize_t i = 0; i < units; i++) if (first[i] < 0) REFUSED("a cone row without variables");
    for (Py_ssize_t j = 0; j < n; j++) size[top(parent, j)]++, number[j] = -1;
    for (Py_ssize_t k = g->lines; k < units; k++) size[top(parent, first[k])] += WIDEST; /* marks cones */
    for (Py_ssize_t j = 0; j < n; j++) { /* blocks from 0 on, the border from -2 on */
        Py_ssize_t own = top(parent, j), inside = 0, entries = 0;
        EACH_GIVEN(j, k) v->indices[k] < p ? entries++ : inside++;
        if (!inside || (size[own] == 1 && entries > DENSE)) {
            number[own] = -2 - border++;
        } else if (number[own] == -1) number[own] = g->blocks++;
    }
    if (!g->blocks) REFUSED("no variable is in a cone");
    if (border > BORDER)
        REFUSED("%zd variables are in no cone or in more than %d equations, at most %d may be", border, DENSE, BORDER);
    g->bound = n - border;
    for (Py_ssize_t j = 0; j < n; j++) {
        Py_ssize_t own = number[top(parent, j)];
        if (own >= 0) g->block[own].to++;
    }
    for (Py_ssize_t i = 0; i < units; i++) {
        Py_ssize_t own = number[top(parent, first[i])];
        if (own < 0) g->outer[-2 - own][1]++;
        else if (i < g->lines) g->block[own].lines++;
        else g->block[own].cones++;
    }
    Py_ssize_t column = 0, line = 0, cone = 0;
    for (Py_ssize_t i = 0; i < g->blocks; i++) {
        Block *b = g->block + i;
        if (b->to > WIDEST)
            REFUSED("%zd variables hang together through cones, more than %d", b->to, WIDEST);
        b->from = next[i] = column, column += b->to, b->to = column;
        b->line = line, line += b->lines, b->cone = cone, cone += b->cones;
    }
    for (Py_ssize_t i = 0; i < border; i++) g->outer[i][0] = line, line += g->outer[i][1];
    for (Py_ssize_t j = 0; j < n; j++) {
        Py_ssize_t own = number[top(parent, j)];
        g->column[own >= 0 ? next[own]++ : g->bound - 2 - own] = j;
    }
    Py_ssize_t after[BORDER];
    for (Py_ssize_t i = 0; i < border; i++) after[i] = g->outer[i][0];
    for (Py_ssize_t i = 0; i < g->blocks; i++) next[i] = g->block[i].line;
    for (Py_ssize_t i = 0; i < g->lines; i++) {
        Py_ssize_t own = number[top(parent, first[i])];
        g->row[own >= 0 ? next[own]++ : after[-2 - own]++] = i;
    }
    for (Py_ssize_t i = 0; i < g->blocks; i++) next[i] = g->block[i].cone;
    for (Py_ssize_t k = 0; k < g->cones; k++) rank[next[number[top(parent, first[g->lines + k])]]++] = k;
    Py_ssize_t *start = first; /* not needed any more */
    for (Py_ssize_t k = 0, i = g->lines; k < g->cones; k++) start[k] = i, i += v->soc[k];
    for (Py_ssize_t k = 0, i = g->lines; k < g->cones; k++) {
        g->place[k] = i;
        for (Py_ssize_t d = 0; d < v->soc[rank[k]]; d++) g->row[i++] = start[rank[k]] + d;
        g->place[k + 1] = i;
    }
    if (!g->cones) g->place[0] = g->lines;
    for (Py_ssize_t i = 0; i < g->blocks; i++) {
        const Block *b = g->block + i;
        Py_ssize_t height = b->lines + g->place[b->cone + b->cones] - g->place[b->cone];
        if (height < b->to - b->from)
            REFUSED("%zd variables in %zd cone rows are not bounded by them", b->to - b->from, height);
    }
    return 1;
}

/* The order of equations, by neighbourhood, into g->equation; ``rank`` is its inverse. */
static int ordered(Program *g, const Given *v, Py_ssize_t *rank) {
    Py_ssize_t p = g->p, entries = v->indptr[g->n], count = 0;
    Py_ssize_t *start = ROOM(Py_ssize_t, p + 1), *block = ROOM(Py_ssize_t, entries), *seen = ROOM(Py_ssize_t, g->blocks);
    g->equation = ROOM(Py_ssize_t, p);
    if (!start || !block || !seen || !g->equation) return -1;
    if (v->order) {
        int is_good = v->orders == p;
        for (Py_ssize_t i = 0; i < p; i++) rank[i] = -1;
        for (Py_ssize_t i = 0; is_good && i < p; i++) {
            is_good = v->order[i] >= 0 && v->order[i] < p && rank[v->order[i]] < 0;
            if (is_good) rank[g->equation[i] = v->order[i]] = i;
        }
        if (!is_good) snprintf(g->said, SAID, "this is no order of its equations");
        return is_good;
    }
    for (int pass = 0; pass < 2; pass++) { /* the blocks of every equation */
        for (Py_ssize_t i = 0; i < g->blocks; i++)
            for (Py_ssize_t j = g->block[i].from; j < g->block[i].to; j++) EACH_GIVEN(g->column[j], k)
                if (v->indices[k] < p) {
                    if (pass) block[start[v->indices[k]]++] = i;
                    else start[v->indices[k] + 1]++;
                }
        if (!pass) for (Py_ssize_t i = 0; i < p; i++) start[i + 1] += start[i];
    }
    for (Py_ssize_t i = p; i > 0; i--) start[i] = start[i - 1];
    start[0] = 0;
    /* twice: the last one of a first order is a good end to begin at */
    for (int pass = 0; pass < 2; pass++) {
        Py_ssize_t end = pass ? g->equation[p - 1] : 0;
        for (Py_ssize_t i = 0; i < p; i++) rank[i] = -1;
        for (Py_ssize_t i = 0; i < g->blocks; i++) seen[i] = 0;
        count = 0;
        for (Py_ssize_t root = 0; root < p; root++) {
            Py_ssize_t at = root ? root - (root <= end) : end; /* the end before all others */
            if (rank[at] >= 0) continue;
            Py_ssize_t done = count;
            rank[at] = count, g->equation[count++] = at;
            for (; done < count; done++)
                for (Py_ssize_t k = start[g->equation[done]]; k < start[g->equation[done] + 1]; k++) {
                    const Block *b = g->block + block[k];
                    if (seen[block[k]]) continue;
                    seen[block[k]] = 1;
                    for (Py_ssize_t j = b->from; j < b->to; j++) EACH_GIVEN(g->column[j], l) {
                        Py_ssize_t other = v->indices[l];
                        if (other < p && rank[other] < 0) rank[other] = count, g->equation[count++] = other;
                    }
                }
        }
    }
    return 1;
}

/* The pattern of what is left of the equations, and where every block's products go in its factor. */
static int patterned(Program *g) {
    Py_ssize_t p = g->p, places = 0, pairs = 0, count = 0;
    for (Py_ssize_t i = 0; i < g->blocks; i++)
        if (g->block[i].closes) {
            Py_ssize_t e = g->block[i].equations;
            places += e, pairs += e * (e + 1) / 2;
        }
    Py_ssize_t *start = ROOM(Py_ssize_t, p + 2), *block = ROOM(Py_ssize_t, places), *local = ROOM(Py_ssize_t, places);
    Py_ssize_t *at = ROOM(Py_ssize_t, p), *slot = g->slots = ROOM(Py_ssize_t, pairs);
    int64_t *indptr = ROOM(int64_t, p + 1), *indices = ROOM(int64_t, pairs + p);
    g->diagonal = ROOM(Py_ssize_t, p);
    if (!start || !block || !local || !at || !slot || !indptr || !indices || !g->diagonal) return -1;
    for (int pass = 0; pass < 2; pass++) { /* the blocks of every equation, and which of theirs it is */
        for (Py_ssize_t i = 0; i < g->blocks; i++) {
            Block *b = g->block + i;
            for (Py_ssize_t k = 0; b->closes && k < b->equations; k++) {
                Py_ssize_t *next = start + g->touched[b->equation + k] + 1 + !pass;
                if (pass) block[*next] = i, local[*next] = k;
                ++*next;
            }
            if (b->closes && pass) b->slot = slot, slot += b->equations * (b->equations + 1) / 2;
        }
        if (!pass) for (Py_ssize_t i = 0; i <= p; i++) start[i + 1] += start[i];
    }
    for (Py_ssize_t j = 0; j < p; j++) at[j] = -1;
#define EACH_PRODUCT(j, row, to, ...) \
    for (Py_ssize_t t = start[j]; t < start[j + 1]; t++) { \
        const Block *b = g->block + block[t]; \
        const Py_ssize_t *own = g->touched + b->equation, k = local[t]; \
        Py_ssize_t *to = b->slot + k * b->equations - k * (k - 1) / 2; \
        for (Py_ssize_t l = k; l < b->equations; l++, to++) { Py_ssize_t row = own[l]; __VA_ARGS__; } \
    }
    for (Py_ssize_t j = 0; j < p; j++) {
        Py_ssize_t first = indptr[j] = count;
        indices[count++] = j, at[j] = first;
        EACH_PRODUCT(j, row, to, if (at[row] < first) at[row] = count, indices[count++] = row)
        qsort(indices + first, count - first, sizeof(int64_t), compared);
        for (Py_ssize_t k = first; k < count; k++) at[indices[k]] = k;
        EACH_PRODUCT(j, row, to, *to = at[row])
    }
    indptr[p] = count;
    g->factor = analysis(p, count, indptr, indices);
    if (!g->factor) return -1;
    for (Py_ssize_t k = 0; k < pairs; k++) g->slots[k] = g->factor->place[g->slots[k]];
    for (Py_ssize_t j = 0; j < p; j++) g->diagonal[j] = g->factor->place[indptr[j]];
    return 1;
}

/* E and G in that order, and the equations of every block. */
static int filled(Program *g, const Given *v) {
    Py_ssize_t entries = v->indptr[g->n], p = g->p, *where = ROOM(Py_ssize_t, g->m), *seen = ROOM(Py_ssize_t, p);
    Py_ssize_t *local = ROOM(Py_ssize_t, p);
    g->start = ROOM(Py_ssize_t, g->m + 1), g->index = ROOM(Py_ssize_t, entries), g->value = ROOM(double, entries);
    g->estart = ROOM(Py_ssize_t, g->n + 1), g->eindex = ROOM(Py_ssize_t, entries);
    g->elocal = ROOM(Py_ssize_t, entries);
    g->evalue = ROOM(double, entries), g->touched = ROOM(Py_ssize_t, entries);
    g->c = ROOM(double, g->n), g->f = ROOM(double, p), g->h = ROOM(double, g->m);
    Py_ssize_t *rank = ROOM(Py_ssize_t, p);
    if (!where || !seen || !local || !rank || !g->start || !g->index || !g->value || !g->estart || !g->eindex || !g->elocal || !g->evalue ||
        !g->touched || !g->c || !g->f || !g->h) return -1;
    int is_ordered = ordered(g, v, rank);
    if (is_ordered < 1) return is_ordered;
    double sum = 0.0;
    Py_ssize_t loaded = 0, used = 0;
    for (Py_ssize_t i = 0; i < p; i++) {
        g->f[rank[i]] = v->b[i], sum += fabs(v->b[i]), loaded += v->b[i] != 0.0;
        seen[i] = -1;
    }
    g->unit = loaded ? sum / loaded : 1.0, g->loads = sum > 0.0 ? sum : 1.0;
    for (Py_ssize_t i = 0; i < g->m; i++) where[g->row[i]] = i, g->h[i] = v->b[p + g->row[i]];
    for (Py_ssize_t j = 0; j < g->n; j++) {
        g->c[j] = v->c[g->column[j]];
        EACH_GIVEN(g->column[j], k)
            if (v->indices[k] >= p) g->start[where[v->indices[k] - p] + 1]++;
            else g->eindex[used] = rank[v->indices[k]], g->evalue[used++] = v->data[k];
        g->estart[j + 1] = used;
    }
    for (Py_ssize_t i = 0; i < g->m; i++) g->start[i + 1] += g->start[i];
    Py_ssize_t *next = ROOM(Py_ssize_t, g->m);
    if (!next) return -1;
    memcpy(next, g->start, sizeof(Py_ssize_t) * g->m);
    for (Py_ssize_t j = 0; j < g->n; j++) EACH_GIVEN(g->column[j], k) if (v->indices[k] >= p) {
        Py_ssize_t at = next[where[v->indices[k] - p]]++;
        g->index[at] = j, g->value[at] = v->data[k];
    }
    Py_ssize_t roots = 0, products = 0, at = 0, widest = 0, part = 0;
    for (Py_ssize_t i = 0; i < g->blocks; i++) {
        Block *b = g->block + i;
        b->equation = at;
        for (Py_ssize_t j = g->estart[b->from]; j < g->estart[b->to]; j++)
            if (seen[g->eindex[j]] != i) seen[g->eindex[j]] = i, g->touched[at++] = g->eindex[j];
        b->equations = at - b->equation;
        qsort(g->touched + b->equation, b->equations, sizeof(Py_ssize_t), compared);
        b->wide = (b->equations + LANES - 1) / LANES * LANES, widest = b->equations > widest ? b->equations : widest;
        Py_ssize_t rows = (b->lines + g->place[b->cone + b->cones] - g->place[b->cone]) * (b->to - b->from);
        part = rows > part ? rows : part;
        roots += (b->to - b->from) * (b->to - b->from), products += (b->to - b->from) * b->wide;
        const Py_ssize_t *own = g->touched + b->equation;
        for (Py_ssize_t k = 0; k < b->equations; k++) local[own[k]] = k;
        for (Py_ssize_t k = g->estart[b->from]; k < g->estart[b->to]; k++) g->elocal[k] = local[g->eindex[k]];
        int is_alike = i && b[-1].equations == b->equations &&
                       !memcmp(own, g->touched + b[-1].equation, sizeof(Py_ssize_t) * b->equations);
        b->opens = !is_alike, b->closes = 1;
        if (is_alike) b[-1].closes = 0;
    }
    g->square = ROOM(double, widest * (widest + 4)), g->part = ROOM(double, part);
    double *root = ROOM(double, roots), *product = ROOM(double, products);
    if (!root || !product || !g->square || !g->part) return -1;
    for (Py_ssize_t i = 0; i < g->blocks; i++) {
        Block *b = g->block + i;
        b->root = root, root += (b->to - b->from) * (b->to - b->from);
        b->product = product, product += (b->to - b->from) * b->wide;
    }
    return patterned(g);
}

static int room_for_point(Program *g, Point *at) {
    at->x = ROOM(double, g->n), at->y = ROOM(double, g->p), at->z = ROOM(double, g->m), at->s = ROOM(double, g->m);
    return at->x && at->y && at->z && at->s;
}

static int room_for_direction(Program *g, Direction *d) {
    d->own = ROOM(double, g->m), d->x = ROOM(double, g->n), d->y = ROOM(double, g->p);
    d->ds = ROOM(double, g->m), d->dz = ROOM(double, g->m);
    return d->own && d->x && d->y && d->ds && d->dz;
}

static int room_for_work(Program *g, Work *w) {
    Py_ssize_t longest = g->m > g->n ? g->m : g->n;
    longest = longest > g->p ? longest : g->p;
    g->border = ROOM(double, (g->n - g->bound) * g->p), g->corner = ROOM(double, BORDER * BORDER);
    g->half = ROOM(double, g->n), g->orders = ROOM(Py_ssize_t, g->bound);
    g->line = ROOM(double, g->lines), g->inverse = ROOM(double, g->lines), g->w = ROOM(double, g->m), g->sizes = ROOM(double, g->cones);
    g->lam = ROOM(double, g->m), g->reciprocal = ROOM(double, g->m);
    w->rx = ROOM(double, g->n), w->ry = ROOM(double, g->p), w->rz = ROOM(double, g->m), w->rhs = ROOM(double, g->n);
    w->left = ROOM(double, g->n + g->p), w->next = ROOM(double, g->n + g->p);
    w->changes = ROOM(double, 2 * ROUNDS * (g->n + g->p));
    w->over = ROOM(double, g->m), w->aim = ROOM(double, g->m), w->a = ROOM(double, g->m), w->b = ROOM(double, longest), w->v = ROOM(double, longest);
    return g->border && g->corner && g->half && g->orders && g->line && g->inverse && g->w && g->sizes && g->lam &&
           g->reciprocal &&
           w->rx && w->ry && w->rz && w->rhs && w->left && w->next && w->changes && w->over && w->aim && w->a && w->b && w->v &&
           room_for_direction(g, &w->found) && room_for_direction(g, &w->tried);
}

/* A program given: sizes and places are checked, for what is wrong would be a crash. */
static int fits(Program *g, const Given *v, Py_ssize_t rows) {
    Py_ssize_t total = g->lines;
    g->are_triples = 1, g->m = rows - g->p, g->degree = g->lines + g->cones;
    if (g->p < 0 || g->lines < 0 || g->lines > g->m || v->indptr[0]) return 0;
    for (Py_ssize_t k = 0; k < g->cones; k++) {
        if (v->soc[k] < 1 || v->soc[k] > g->m - total) return 0;
        total += v->soc[k], g->are_triples &= v->soc[k] == 3;
    }
    for (Py_ssize_t j = 0; j < g->n; j++) if (v->indptr[j] > v->indptr[j + 1]) return 0;
    for (Py_ssize_t k = 0; k < v->indptr[g->n]; k++) if (v->indices[k] < 0 || v->indices[k] >= rows) return 0;
    return total == g->m;
}

#define TAKEN(g) \
    DOUBLES(c, 0, ANY); \
    g->n = LENGTH; \
    INTEGERS(int32_t, indptr, 1, g->n + 1); \
    INTEGERS(int32_t, indices, 2, indptr[g->n]); \
    DOUBLES(data, 3, indptr[g->n]); \
    DOUBLES(b, 4, ANY); \
    Py_ssize_t rows = LENGTH; \
    g->p = PyLong_AsSsize_t(args[5]), g->lines = PyLong_AsSsize_t(args[6]); \
    if (PyErr_Occurred()) goto fail; \
    INTEGERS(int64_t, soc, 7, ANY); \
    g->cones = LENGTH; \
    Given v = {c, b, data, indptr, indices, soc, NULL, 0}; \
    CHECK(fits(g, &v, rows), "the matrix does not fit the cones")

/* blocks(c, indptr, indices, data, b, zero, orthant, soc, block): the number of every column's block, -1 on
 * the border; returns what does not suit. */
static PyObject *blocks(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(9);
    Program program = {0}, *g = &program;
    TAKEN(g);
    WRITTEN(int64_t, block, 8, g->n);
    opened(g);
    int is_good = grouped(g, &v);
    for (Py_ssize_t j = 0; is_good > 0 && j < g->n; j++) block[j] = -1;
    for (Py_ssize_t i = 0; is_good > 0 && i < g->blocks; i++)
        for (Py_ssize_t j = g->block[i].from; j < g->block[i].to; j++) block[g->column[j]] = i;
    closed(g);
    if (is_good < 0) NO_MEMORY;
    END(PyUnicode_FromString(g->said));
}

/* minimise(c, indptr, indices, data, b, zero, orthant, soc, order, (tolerance, residual, enough), max_iter,
 * starts, point, way, powers): status, objective, iterations, points on the way, and what does
 * not suit. */
static PyObject *minimise(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(15);
    Program program = {0}, *g = &program;
    Run run = {0};
    TAKEN(g);
    INTEGERS(int64_t, order, 8, ANY);
    Py_ssize_t orders = LENGTH;
    DOUBLES(asked, 9, 3);
    run.tolerance = asked[0], run.residual = asked[1], run.enough = asked[2];
    run.most = PyLong_AsSsize_t(args[10]);
    if (PyErr_Occurred()) goto fail;
    const Py_ssize_t size = g->n + g->p + 2 * g->m;
    DOUBLES(starts, 11, ANY);
    run.starts = starts, run.given = size ? LENGTH / size : 0;
    RESULT(point, 12, size);
    RESULT(way, 13, ANY);
    run.way = way, run.room = size ? LENGTH / size : 0;
    WRITTEN(int64_t, power, 14, run.room);
    run.power = power;
    g->target = smaller(larger(TARGET, WIDER * run.tolerance), LOOSEST);
    g->hard = HARD * TARGET / g->target;
    Status status = UNSUITED;
    int is_good;
    double value = NAN;
    Work work;
    Point at, spare, change, best;
    opened(g);
    Py_BEGIN_ALLOW_THREADS
    v.order = orders ? order : NULL, v.orders = orders;
    is_good = grouped(g, &v);
    if (is_good > 0) is_good = filled(g, &v);
    if (is_good > 0)
        is_good = room_for_work(g, &work) && room_for_point(g, &at) && room_for_point(g, &spare) &&
                  room_for_point(g, &change) && room_for_point(g, &best) ? 1 : -1;
    if (is_good > 0) {
        status = minimised(g, &work, &at, &spare, &change, &best, &run);
        if (status == UNSUITED)
            snprintf(g->said, SAID, "some variables are neither in a cone nor in independent equations");
        else {
            handed(g, &best, point);
            value = long_dot(g->c, best.x, g->n);
        }
    }
    Py_END_ALLOW_THREADS
    closed(g);
    if (is_good < 0) NO_MEMORY;
    END(Py_BuildValue("(idnns)", (int)status, value, run.count, run.ways, g->said));
}

static PyMethodDef functions[] = {FUNCTION(minimise), FUNCTION(blocks), NO_FUNCTION};

MODULE(_interior, functions)
