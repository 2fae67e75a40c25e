/* The interior point of iteration.py for small programs, whole: min c'x subject to E x = f, G x + s = h,
 * s in K, whose variables fall into small blocks that no row of G joins. On some hundred copies of
 * contacts NumPy's calls take longer than what they compute.
 *
 * Every block's variables are eliminated by a Cholesky factor of its own; what is left is a matrix with a
 * row per equation, dense within its envelope: equations are ordered by neighbourhood (E. Cuthill, J.
 * McKee, 1969). A few variables may be in no cone at all, as a load factor is, or in many equations: they
 * border it. Rows of G and columns come block by block. */

#include "../dense.h"

#define BORDER 8   /* most variables in no cone or in more equations than these: */
#define DENSE 24
#define PANEL 48   /* columns of the equations' matrix that are eliminated together */
#define WIDEST 40  /* most of a block, */
#define LARGEST 8  /* and of a cone */
#define MOST_EQUATIONS 1500
#define ROOMS 96
#define MOST_PATIENCE 16 /* iterations that are remembered */
#define MOST_KEPT (64 << 20) /* bytes */

/* Those of iteration.py and blocks.py, which are handed over by name: numbers() says which. */
#define EACH_NUMBER(X) \
    X(reach) X(correctors) X(widen) X(band) X(gain) X(long_step) X(patience) X(shortest) X(retreat) X(solved) \
    X(almost) X(late) X(balance) X(no_answer) X(middle) X(floor) X(light) X(ahead) X(thin) X(shift) X(nearest) \
    X(least_value) X(rounds) X(regularisation)
#define FIELD(name) double name;
#define WORD(name) #name " "

typedef struct {
    EACH_NUMBER(FIELD)
} Numbers;

typedef enum { UNSUITED, IS_SOLVED, IS_ALMOST, STALLED, INFEASIBLE, UNBOUNDED } Status;

typedef struct {
    Py_ssize_t from, to;           /* columns, */
    Py_ssize_t line, lines;        /* linear rows, */
    Py_ssize_t cone, cones;        /* second-order cones, */
    Py_ssize_t equation, equations; /* equations, as places in ``touched``, */
    double *root, *product;        /* L and L' (c, c) of the block's G' W^-2 G, with 1 / L_ii between, and L^-1 E' (c, wide) */
    Py_ssize_t wide;               /* e, rounded up to whole lanes */
    int opens, closes;             /* the first and the last of several blocks with the same equations */
} Block;

typedef struct {
    Numbers by;
    Py_ssize_t n, p, m, lines, cones, bound, degree; /* ``bound`` columns are in blocks, others the border */
    Py_ssize_t blocks;
    int are_triples;               /* all cones have three rows */
    Block *block;
    Py_ssize_t *column, *row;      /* where columns and rows of G were in the program given, */
    Py_ssize_t *equation, *reach;  /* where equations were; the last one that each one's column reaches */
    Py_ssize_t outer[BORDER][2];   /* linear rows of columns of the border: the first, how many */
    Py_ssize_t *start, *index;     /* G by rows */
    double *value;
    Py_ssize_t *estart, *eindex, *elocal; /* E by columns, and where in the block's equations an entry is */
    double *evalue, *square;
    Py_ssize_t *touched, *place;   /* equations of blocks; where cones start among the rows */
    double *c, *f, *h;
    double *schur, *border, *corner, *room;
    double *line, *inverse, *w, *sizes, *lam; /* scaling: of linear rows W and W^-1, frames and sizes of cones */
    double *reciprocal;            /* 1 / lam; of cones over the root of its determinant, and what steps divide by */
    double *half;
    double unit, loads;
    char *store;                   /* where rooms are, as far as it suffices: its size, how much is used, */
    size_t stored, used, wanted;   /* and how much would be */
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

/* L of the block's G' W^-2 G, and L^-1 E', whose square is added to the Schur complement. */
WIDE static int eliminated_block(const Program *g, const Block *b) {
    Py_ssize_t c = b->to - b->from, e = b->equations;
    double H[WIDEST * WIDEST], rows[LARGEST][WIDEST], diagonal[WIDEST], reciprocal[WIDEST];
    double *L = b->root, *P = b->product;
    const Py_ssize_t *at = g->touched + b->equation;
    memset(H, 0, sizeof(double) * c * c);
    for (Py_ssize_t i = b->line; i < b->line + b->lines; i++) {
        double weight = g->inverse[i] * g->inverse[i];
        for (Py_ssize_t k = g->start[i]; k < g->start[i + 1]; k++) {
            double own = weight * g->value[k], *to = H + (g->index[k] - b->from) * c;
            for (Py_ssize_t l = g->start[i]; l < g->start[i + 1]; l++) to[g->index[l] - b->from] += own * g->value[l];
        }
    }
    for (Py_ssize_t number = b->cone; number < b->cone + b->cones; number++) {
        Py_ssize_t from = g->place[number], d = g->place[number + 1] - from;
        const double *w = g->w + from;
        double scale = 1.0 / g->sizes[number], cross[WIDEST];
        memset(cross, 0, sizeof(double) * c);
        for (Py_ssize_t i = 0; i < d; i++) {
            double *own = rows[i];
            memset(own, 0, sizeof(double) * c);
            for (Py_ssize_t k = g->start[from + i]; k < g->start[from + i + 1]; k++)
                own[g->index[k] - b->from] += g->value[k];
            if (i) for (Py_ssize_t j = 0; j < c; j++) cross[j] += w[i] * own[j];
        }
        for (Py_ssize_t i = d - 1; i >= 0; i--) {
            double *own = rows[i];
            for (Py_ssize_t j = 0; j < c; j++)
                own[j] = scale * (i ? own[j] + (cross[j] / (1.0 + w[0]) - rows[0][j]) * w[i] : w[0] * own[j] - cross[j]);
        }
        for (Py_ssize_t i = 0; i < d; i++)
            for (Py_ssize_t j = 0; j < c; j++) {
                double own = rows[i][j], *to = H + j * c;
                if (own != 0.0)
                    for (Py_ssize_t l = j; l < c; l++) to[l] += own * rows[i][l];
            }
    }
    double largest = 0.0;
    for (Py_ssize_t i = 0; i < c; i++) largest = larger(largest, diagonal[i] = H[i * c + i]);
    for (Py_ssize_t j = 0; j < c; j++) {
        double *own = H + j * c, pivot = own[j], given = diagonal[j];
        if (!(pivot > -1e-3 * largest)) return 0; /* NaN, too */
        double inverse = reciprocal[j] = 1.0 / larger(pivot, g->by.regularisation * larger(given, g->by.regularisation * largest));
        for (Py_ssize_t i = j + 1; i < c; i++) {
            double share = own[i] * inverse, *to = H + i * c;
            for (Py_ssize_t l = i; l < c; l++) to[l] -= share * own[l];
        }
    }
    for (Py_ssize_t j = 0; j < c; j++) { /* roots at the end: there they need not wait for one another */
        double root = L[j * c + j] = sqrt(reciprocal[j]);
        for (Py_ssize_t l = j + 1; l < c; l++) L[l * c + j] = L[j * c + l] = H[j * c + l] * root;
    }
    memset(P, 0, sizeof(double) * c * b->wide);
    for (Py_ssize_t j = 0; j < c; j++)
        for (Py_ssize_t k = g->estart[b->from + j]; k < g->estart[b->from + j + 1]; k++)
            P[j * b->wide + g->elocal[k]] += g->evalue[k];
    switch (b->wide / LANES) { /* compilers unroll what has a known length */
        case 1: squared(b, 1, P, g->square); break;
        case 2: squared(b, 2, P, g->square); break;
        case 3: squared(b, 3, P, g->square); break;
        default: squared(b, b->wide / LANES, P, g->square);
    }
    if (b->closes)
        for (Py_ssize_t k = 0; k < e; k++)
            for (Py_ssize_t l = k; l < e; l++) g->schur[at[k] * g->p + at[l]] += g->square[k * b->wide + l];
    return 1;
}

WIDE static void forward(const Program *g, double *x) {
    for (Py_ssize_t j = 0; j < g->p; j++) {
        const double *own = g->schur + j * g->p;
        double value = x[j] /= own[j];
        for (Py_ssize_t i = j + 1; i <= g->reach[j]; i++) x[i] -= own[i] * value;
    }
}

WIDE static void backward(const Program *g, double *x) {
    for (Py_ssize_t j = g->p - 1; j >= 0; j--) {
        const double *own = g->schur + j * g->p;
        double sums[4] = {0.0, 0.0, 0.0, 0.0};
        Py_ssize_t i = j + 1, end = g->reach[j] + 1;
        for (; i + 4 <= end; i += 4)
            for (int t = 0; t < 4; t++) sums[t] += own[i + t] * x[i + t];
        for (; i < end; i++) sums[0] += own[i] * x[i];
        x[j] = (x[j] - (sums[0] + sums[1] + sums[2] + sums[3])) / own[j];
    }
}

/* The Cholesky factor of the equations' matrix in place, which is zero beyond the reach of columns. */
static int eliminated_equations(const Program *g) {
    Py_ssize_t p = g->p;
    for (Py_ssize_t at = 0, first = 0; at < p; at += PANEL) {
        Py_ssize_t end = at + PANEL < p ? at + PANEL : p, below = g->reach[end - 1] + 1 - at;
        double *own = g->schur + at + at * p, *before = g->schur + at;
        while (first < at && g->reach[first] < at) first++;
        if (first < at)
            multiplied(below, end - at, at - first, before + first * p, p, before + first * p, p, own, p, SUBTRACT,
                       g->room);
        if (!eliminated(below, end - at, own, p, g->room)) return 0;
    }
    return 1;
}

static int factorised(const Program *g) {
    Py_ssize_t p = g->p;
    for (Py_ssize_t j = 0; j < p; j++) memset(g->schur + j * p + j, 0, sizeof(double) * (g->reach[j] + 1 - j));
    for (Py_ssize_t i = 0; i < g->blocks; i++)
        if (!eliminated_block(g, g->block + i)) return 0;
    for (Py_ssize_t i = 0; i < p; i++) {
        double own = g->schur[i * p + i] * (1.0 + g->by.regularisation);
        g->schur[i * p + i] = own > 0.0 ? own : 1.0;
    }
    if (!eliminated_equations(g)) return 0;
    for (Py_ssize_t i = 0; i < g->n - g->bound; i++) { /* half of what the border becomes: its square is the corner */
        double *own = g->border + i * p;
        Py_ssize_t j = g->bound + i;
        memset(own, 0, sizeof(double) * p);
        for (Py_ssize_t l = g->estart[j]; l < g->estart[j + 1]; l++) own[g->eindex[l]] = g->evalue[l];
        forward(g, own);
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
        memcpy(own, rx + b->from, sizeof(double) * c);
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
    forward(g, y);
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
    backward(g, y);
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
            double value = to[j] = own[j] * before[j];
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
    double both = long_dot(at->s, at->z, g->m), primal = long_dot(g->c, at->x, g->n), size = larger(fabs(primal), g->by.least_value);
    double in_x = most_of(w->rx, g->n), in_y = most_of(w->ry, g->p), in_z = most_of(w->rz, g->m);
    double missing = in_x / larger(1.0, larger(most_of(at->z, g->m), most_of(at->y, g->p)));
    r.dual = -long_dot(g->f, at->y, g->p) - long_dot(g->h, at->z, g->m);
    r.gap = both / size;
    r.mu = both / g->degree;
    r.infeasibility = larger(larger(in_y, in_z) / larger(1.0, most_of(at->x, g->n)), missing);
    /* what the certificate may lose: iteration.py says why */
    double cost = g->loads / size, outside = -margin(g, w->a);
    r.score = r.gap + larger(missing, in_x * cost) + g->by.thin * (in_y + larger(outside, 0.0)) / g->unit;
    double share = g->by.light * larger(g->by.ahead * smaller(r.gap, 1.0), tolerance);
    r.allowed_x = share / cost, r.allowed_y = share * g->unit;
    return r;
}

static int is_within(const Program *g, const Measure *r, double tolerance) {
    return r->gap < tolerance && r->infeasibility < larger(g->by.solved, g->by.balance * tolerance);
}

/* A proof that there is no optimum; ``at`` becomes it. */
static Status no_answer(const Program *g, Point *at, const Measure *r, const Work *w) {
    if (r->dual > 0.0) {
        double most = 0.0;
        for (Py_ssize_t j = 0; j < g->n; j++) most = larger(most, fabs(w->rx[j] + g->c[j]));
        if (most < g->by.no_answer * r->dual) {
            for (Py_ssize_t i = 0; i < g->p; i++) at->y[i] /= r->dual;
            for (Py_ssize_t i = 0; i < g->m; i++) at->z[i] /= r->dual;
            return INFEASIBLE;
        }
    }
    double primal = long_dot(g->c, at->x, g->n), most = 0.0;
    if (primal < 0.0) {
        for (Py_ssize_t i = 0; i < g->p; i++) most = larger(most, fabs(g->f[i] - w->ry[i]));
        for (Py_ssize_t i = 0; i < g->m; i++) most = larger(most, fabs(g->h[i] - w->rz[i]));
        if (most < -g->by.no_answer * primal) return UNBOUNDED;
    }
    return UNSUITED;
}

static void lengths(const Program *g, Direction *d) {
    d->primal = smaller(1.0, g->by.reach * step(g, d->ds));
    d->dual = smaller(1.0, g->by.reach * step(g, d->dz));
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
    double share = clip(ahead / g->degree / r->mu, 0.0, 1.0), goal = larger(share * share * share, g->by.nearest) * r->mu;
    product(g, d->ds, d->dz, w->a);
    for (Py_ssize_t i = 0; i < g->m; i++) w->aim[i] = -w->v[i] - w->a[i];
    for (Py_ssize_t i = 0; i < g->lines; i++) w->aim[i] += goal;
    for (Py_ssize_t k = 0; k < g->cones; k++) w->aim[g->place[k]] += goal;
    directed(g, w, d);
    for (int i = 0; i < (int)g->by.correctors && shorter(d) <= g->by.long_step; i++) {
        double before = shorter(d), wider = smaller(1.0, before + g->by.widen);
        for (Py_ssize_t j = 0; j < g->m; j++) {
            w->a[j] = g->lam[j] + wider * d->ds[j];
            w->b[j] = g->lam[j] + wider * d->dz[j];
        }
        product(g, w->a, w->b, w->v);
        towards(g, w->v, g->by.band * goal, goal / g->by.band, w->aim);
        directed(g, w, &w->tried);
        double now = shorter(&w->tried);
        if (now > before) {
            Direction other = w->found;
            w->found = w->tried, w->tried = other;
        }
        if (!(now >= before + g->by.gain * g->by.widen)) break;
    }
}

/* The change that w->found stands for, refined until what it leaves does no harm. */
static void refined(const Program *g, Work *w, const Measure *r, Point *change) {
    Direction *d = &w->found;
    double before = INFINITY;
    for (int round = 0;; round++) {
        times(g, d->dz, -1.0, change->z);
        memcpy(w->rhs, w->rx, sizeof(double) * g->n);
        for (Py_ssize_t i = 0; i < g->m; i++) w->a[i] = -change->z[i];
        add_by_columns(g, w->a, w->rhs);
        for (Py_ssize_t i = 0; i < g->p; i++) w->b[i] = -d->y[i];
        add_equations(g, w->b, w->rhs);
        equations_of(g, d->x, w->v);
        for (Py_ssize_t i = 0; i < g->p; i++) w->v[i] = w->ry[i] - w->v[i];
        double error = larger(most_of(w->rhs, g->n) / r->allowed_x, most_of(w->v, g->p) / r->allowed_y);
        if (round == (int)g->by.rounds || !(error > 1.0) || !(error < 0.5 * before)) break;
        before = error;
        halved(g, w->rhs, w->v, w->tried.x, w->tried.y);
        by_rows(g, w->tried.x, w->a);
        times(g, w->a, -1.0, w->b);
        for (Py_ssize_t j = 0; j < g->n; j++) d->x[j] += w->tried.x[j];
        for (Py_ssize_t i = 0; i < g->p; i++) d->y[i] += w->tried.y[i];
        for (Py_ssize_t i = 0; i < g->m; i++) d->dz[i] += w->b[i], d->ds[i] -= w->b[i];
    }
    lengths(g, d);
    memcpy(change->x, d->x, sizeof(double) * g->n);
    memcpy(change->y, d->y, sizeof(double) * g->p);
    times(g, d->ds, 1.0, change->s);
}

static void copied(const Program *g, const Point *from, Point *to) {
    memcpy(to->x, from->x, sizeof(double) * g->n), memcpy(to->y, from->y, sizeof(double) * g->p);
    memcpy(to->z, from->z, sizeof(double) * g->m), memcpy(to->s, from->s, sizeof(double) * g->m);
}

/* The point further along the change, strictly inside; 0 where rounding ends the iteration. */
static int moved(const Program *g, const Work *w, Point *at, const Point *change, Point *to) {
    double primal = w->found.primal, dual = w->found.dual;
    while (larger(primal, dual) > g->by.shortest) {
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
        primal *= g->by.retreat, dual *= g->by.retreat;
    }
    return 0;
}

static double mean_size(const double *v, Py_ssize_t n) {
    double sum = 0.0;
    for (Py_ssize_t i = 0; i < n; i++) sum += fabs(v[i]);
    return n ? sum / n : 0.0;
}

static void moved_inside(const Program *g, double *v, const double *beside, Py_ssize_t count) {
    double least = margin(g, v), size = larger(mean_size(v, g->m), g->by.floor * mean_size(beside, count));
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

/* A point given, moved inside the cones; 0 if it is none. */
static int warm(const Program *g, Point *at) {
    double *sides[] = {at->z, at->s};
    for (int i = 0; i < 2; i++) {
        double more = g->by.shift * mean_size(sides[i], g->m);
        for (Py_ssize_t j = 0; j < g->lines; j++) sides[i][j] += more;
        for (Py_ssize_t k = 0; k < g->cones; k++) sides[i][g->place[k]] += more;
        if (!(margin(g, sides[i]) > 0.0)) return 0;
    }
    return is_finite(at->x, g->n) && is_finite(at->y, g->p) && is_finite(at->z, g->m) && is_finite(at->s, g->m);
}

/* The best point in ``best``, one on the way to it in ``middle``; ``enough`` is a value of the dual
 * objective that ends the iteration. */
static Status minimised(const Program *g, Work *w, Point *at, Point *spare, Point *change, Point *best,
                        Point *middle, double tolerance, double enough, int starts, Py_ssize_t most,
                        Py_ssize_t *count) {
    double scores[MOST_PATIENCE], worst = INFINITY, rank = INFINITY, least = INFINITY;
    int is_solved = 0, has_middle = 0;
    const Py_ssize_t patience = (Py_ssize_t)g->by.patience;
    if (!(starts && warm(g, at)) && !cold(g, w, at)) return UNSUITED;
    copied(g, at, best), copied(g, at, middle);
    for (*count = 0;; ++*count) {
        Measure r = measured(g, at, w, tolerance);
        int is_enough = is_within(g, &r, larger(g->by.solved, tolerance));
        if (is_enough > is_solved || (is_enough == is_solved && r.score < rank)) {
            copied(g, at, best);
            is_solved = is_enough, rank = r.score;
        }
        least = smaller(least, r.score);
        worst = smaller(worst, larger(r.gap, r.infeasibility));
        if (!has_middle && worst < g->by.middle) {
            copied(g, at, middle);
            has_middle = 1;
        }
        Status none = no_answer(g, at, &r, w);
        if (none != UNSUITED) {
            copied(g, at, best);
            return none;
        }
        int is_late = worst < g->by.solved || r.gap < g->by.late;
        double before = *count >= patience ? scores[*count % patience] : INFINITY;
        scores[*count % patience] = least;
        if (is_within(g, &r, tolerance) || (is_late && least > 0.5 * before && *count >= patience)) break;
        if (r.dual >= enough && most_of(w->rx, g->n) * g->loads <= g->by.light * fabs(r.dual - enough)) {
            copied(g, at, best);
            return IS_SOLVED;
        }
        if (*count == most || !scaled(g, at->s, at->z) || !factorised(g)) break;
        aimed(g, w, &r);
        refined(g, w, &r, change);
        int is_good = is_finite(change->x, g->n) && is_finite(change->y, g->p) && is_finite(change->z, g->m) &&
                      is_finite(change->s, g->m);
        if (!is_good || !moved(g, w, at, change, spare)) break;
    }
    return is_solved ? IS_SOLVED : worst < g->by.almost ? IS_ALMOST : STALLED;
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

static int ascending(const void *a, const void *b) {
    Py_ssize_t i = *(const Py_ssize_t *)a, j = *(const Py_ssize_t *)b;
    return (i > j) - (i < j);
}

/* A program as CVXPY gives it: A by columns, rows of E before those of G. */
typedef struct {
    const double *c, *b, *data;
    const int32_t *indptr, *indices;
    const int64_t *soc;
} Given;

#define ROOM(type, count) room(g, count, sizeof(type))
#define EACH_GIVEN(j, k) for (int32_t k = v->indptr[j]; k < v->indptr[j + 1]; k++)

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
        if (v->soc[k] < 2 || v->soc[k] > LARGEST) return 0;
        for (Py_ssize_t d = 0; d < v->soc[k]; d++) unit[i++] = g->lines + k;
    }
    for (Py_ssize_t i = 0; i < units; i++) first[i] = -1;
    for (Py_ssize_t j = 0; j < n; j++) parent[j] = j;
    for (Py_ssize_t j = 0; j < n; j++) EACH_GIVEN(j, k) if (v->indices[k] >= p) {
        Py_ssize_t own = unit[v->indices[k] - p];
        if (first[own] < 0) first[own] = j;
        else parent[top(parent, j)] = top(parent, first[own]);
    }
    for (Py_ssize_t i = 0; i < units; i++) if (first[i] < 0) return 0;
    for (Py_ssize_t j = 0; j < n; j++) size[top(parent, j)]++, number[j] = -1;
    for (Py_ssize_t k = g->lines; k < units; k++) size[top(parent, first[k])] += WIDEST; /* marks cones */
    for (Py_ssize_t j = 0; j < n; j++) { /* blocks from 0 on, the border from -2 on */
        Py_ssize_t own = top(parent, j), inside = 0, entries = 0;
        EACH_GIVEN(j, k) v->indices[k] < p ? entries++ : inside++;
        if (!inside || (size[own] == 1 && entries > DENSE)) {
            if (border == BORDER) return 0;
            number[own] = -2 - border++;
        } else if (number[own] == -1) number[own] = g->blocks++;
    }
    if (!g->blocks) return 0;
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
        if (b->to > WIDEST) return 0;
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
    return 1;
}

/* The order of equations, by neighbourhood, into g->equation; ``rank`` is its inverse. */
static int ordered(Program *g, const Given *v, Py_ssize_t *rank) {
    Py_ssize_t p = g->p, entries = v->indptr[g->n], count = 0;
    Py_ssize_t *start = ROOM(Py_ssize_t, p + 1), *block = ROOM(Py_ssize_t, entries), *seen = ROOM(Py_ssize_t, g->blocks);
    g->equation = ROOM(Py_ssize_t, p), g->reach = ROOM(Py_ssize_t, p);
    if (!start || !block || !seen || !g->equation || !g->reach) return 0;
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
    if (!ordered(g, v, rank)) return -1;
    double sum = 0.0;
    Py_ssize_t loaded = 0, used = 0;
    for (Py_ssize_t i = 0; i < p; i++) {
        g->f[rank[i]] = v->b[i], sum += fabs(v->b[i]), loaded += v->b[i] != 0.0;
        seen[i] = -1, g->reach[i] = i;
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
    Py_ssize_t roots = 0, products = 0, at = 0, widest = 0;
    for (Py_ssize_t i = 0; i < g->blocks; i++) {
        Block *b = g->block + i;
        b->equation = at;
        for (Py_ssize_t j = g->estart[b->from]; j < g->estart[b->to]; j++)
            if (seen[g->eindex[j]] != i) seen[g->eindex[j]] = i, g->touched[at++] = g->eindex[j];
        b->equations = at - b->equation;
        qsort(g->touched + b->equation, b->equations, sizeof(Py_ssize_t), ascending);
        b->wide = (b->equations + LANES - 1) / LANES * LANES, widest = b->equations > widest ? b->equations : widest;
        roots += (b->to - b->from) * (b->to - b->from), products += (b->to - b->from) * b->wide;
        const Py_ssize_t *own = g->touched + b->equation;
        for (Py_ssize_t k = 0; k < b->equations; k++) local[own[k]] = k;
        for (Py_ssize_t k = g->estart[b->from]; k < g->estart[b->to]; k++) g->elocal[k] = local[g->eindex[k]];
        for (Py_ssize_t k = 0, last = b->equations - 1; k < last; k++)
            if (g->reach[own[k]] < own[last]) g->reach[own[k]] = own[last];
        int is_alike = i && b[-1].equations == b->equations &&
                       !memcmp(own, g->touched + b[-1].equation, sizeof(Py_ssize_t) * b->equations);
        b->opens = !is_alike, b->closes = 1;
        if (is_alike) b[-1].closes = 0;
    }
    for (Py_ssize_t i = 1; i < p; i++) /* the factor fills in */
        if (g->reach[i] < g->reach[i - 1]) g->reach[i] = g->reach[i - 1];
    g->square = ROOM(double, widest * (widest + 4));
    double *root = ROOM(double, roots), *product = ROOM(double, products);
    if (!root || !product || !g->square) return -1;
    for (Py_ssize_t i = 0; i < g->blocks; i++) {
        Block *b = g->block + i;
        b->root = root, root += (b->to - b->from) * (b->to - b->from);
        b->product = product, product += (b->to - b->from) * b->wide;
    }
    return 1;
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
    g->schur = ROOM(double, g->p * g->p), g->border = ROOM(double, BORDER * g->p), g->corner = ROOM(double, BORDER * BORDER);
    g->room = ROOM(double, DEEP * (g->p + BROAD + TALL)), g->half = ROOM(double, g->n);
    g->line = ROOM(double, g->lines), g->inverse = ROOM(double, g->lines), g->w = ROOM(double, g->m), g->sizes = ROOM(double, g->cones);
    g->lam = ROOM(double, g->m), g->reciprocal = ROOM(double, g->m);
    w->rx = ROOM(double, g->n), w->ry = ROOM(double, g->p), w->rz = ROOM(double, g->m), w->rhs = ROOM(double, g->n);
    w->over = ROOM(double, g->m), w->aim = ROOM(double, g->m), w->a = ROOM(double, g->m), w->b = ROOM(double, longest), w->v = ROOM(double, longest);
    return g->schur && g->border && g->corner && g->room && g->half && g->line && g->inverse && g->w && g->sizes && g->lam &&
           g->reciprocal &&
           w->rx && w->ry && w->rz && w->rhs && w->over && w->aim && w->a && w->b && w->v &&
           room_for_direction(g, &w->found) && room_for_direction(g, &w->tried);
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

/* minimise(c, indptr, indices, data, b, zero, orthant, soc, tolerance, max_iter, enough, starts, point,
 * middle, numbers): status and iterations. ``point`` holds a start, if it ``starts``, and then the answer. */
static PyObject *minimise(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(15);
    Program program = {0}, *g = &program;
    DOUBLES(c, 0, ANY);
    g->n = LENGTH;
    INTEGERS(int32_t, indptr, 1, g->n + 1);
    INTEGERS(int32_t, indices, 2, indptr[g->n]);
    DOUBLES(data, 3, indptr[g->n]);
    DOUBLES(b, 4, ANY);
    Py_ssize_t rows = LENGTH;
    g->p = PyLong_AsSsize_t(args[5]), g->lines = PyLong_AsSsize_t(args[6]);
    INTEGERS(int64_t, soc, 7, ANY);
    g->cones = LENGTH, g->are_triples = 1, g->m = rows - g->p, g->degree = g->lines + g->cones;
    double tolerance = PyFloat_AsDouble(args[8]), enough = PyFloat_AsDouble(args[10]);
    Py_ssize_t most = PyLong_AsSsize_t(args[9]), total = g->lines, count = 0;
    int starts = (int)PyLong_AsLong(args[11]);
    if (PyErr_Occurred()) goto fail;
    int is_good = g->p >= 0 && g->lines >= 0 && g->m >= 0 && g->lines <= g->m && indptr[0] == 0;
    for (Py_ssize_t k = 0; is_good && k < g->cones; k++) {
        is_good = soc[k] > 0 && soc[k] <= g->m - total;
        total += soc[k], g->are_triples &= soc[k] == 3;
    }
    is_good = is_good && total == g->m;
    for (Py_ssize_t j = 0; is_good && j < g->n; j++) is_good = indptr[j] <= indptr[j + 1];
    for (Py_ssize_t k = 0; is_good && k < indptr[g->n]; k++) is_good = indices[k] >= 0 && indices[k] < rows;
    CHECK(is_good, "the matrix does not fit the cones");
    RESULT(point, 12, g->n + g->p + 2 * g->m);
    RESULT(halfway, 13, g->n + g->p + 2 * g->m);
    DOUBLES(by, 14, sizeof(Numbers) / sizeof(double));
    memcpy(&g->by, by, sizeof(Numbers));
    CHECK(g->by.patience >= 1.0 && g->by.patience < MOST_PATIENCE, "patience is too long");
    Status status = UNSUITED;
    Work work;
    Point at, spare, change, best, middle;
    opened(g);
    Py_BEGIN_ALLOW_THREADS
    Given v = {c, b, data, indptr, indices, soc};
    is_good = g->p > 0 && g->p <= MOST_EQUATIONS ? grouped(g, &v) : 0;
    if (is_good > 0) is_good = filled(g, &v);
    if (is_good > 0)
        is_good = room_for_work(g, &work) && room_for_point(g, &at) && room_for_point(g, &spare) &&
                  room_for_point(g, &change) && room_for_point(g, &best) && room_for_point(g, &middle) ? 1 : -1;
    if (is_good > 0) {
        if (starts) taken(g, point, &at);
        status = minimised(g, &work, &at, &spare, &change, &best, &middle, tolerance, enough, starts, most, &count);
        handed(g, &best, point), handed(g, &middle, halfway);
    }
    Py_END_ALLOW_THREADS
    closed(g);
    if (is_good < 0) NO_MEMORY;
    END(Py_BuildValue("(in)", (int)status, count));
}

static PyObject *numbers(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    return PyUnicode_FromString(EACH_NUMBER(WORD));
}

static PyMethodDef functions[] = {FUNCTION(minimise), FUNCTION(numbers), NO_FUNCTION};

MODULE(_small, functions)
