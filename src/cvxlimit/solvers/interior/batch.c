/* The batched part of the interior point: what cones.py and blocks.py do for slabs of equal cones and
 * groups of equal blocks. compiled.py calls it; without it NumPy does the same.
 *
 * Arrays are contiguous doubles or 64-bit integers (CSR's are 32-bit). Cones are given by their layout:
 * the orthant's size, then d and k of every slab of k second-order cones of size d, which is stored
 * component by component (d, k). Matrices of a group's k equal blocks come in tiles of LANES blocks: (tiles,
 * i, j, LANES). */

#include "../arguments.h"

#define SMALL (1LL << 20) /* beyond any size of a group: three such sizes can be multiplied */

/* ---- several at a time ---- */

/* Some of k entries; beyond the last it is repeated. */
INLINE Lanes loaded(const double *entries, Py_ssize_t first, Py_ssize_t k) {
    Lanes result;
    if (first + LANES <= k) return *(const Lanes *)(entries + first);
    LANE OF(result) = entries[first + l < k ? first + l : k - 1];
    return result;
}

INLINE Lanes rooted(Lanes v) {
    LANE OF(v) = sqrt(OF(v));
    return v;
}

INLINE void store(double *entries, Py_ssize_t first, Py_ssize_t k, Lanes v) {
    if (first + LANES <= k) *(Lanes *)(entries + first) = v;
    else LANE if (first + l < k) entries[first + l] = OF(v);
}

/* The largest number of each lane, and where one was NaN. */
typedef struct {
    Lanes most;
    Mask is_nan;
} Largest;

INLINE void compare(Largest *at, Lanes own) {
    LANE OF(at->most) = OF(own) > OF(at->most) ? OF(own) : OF(at->most);
    at->is_nan |= (Mask)(own != own);
}

static double of_all(const Largest *at) {
    const int64_t *is_nan = (const int64_t *)&at->is_nan;
    double result = -INFINITY;
    LANE result = OF(at->most) > result ? OF(at->most) : result;
    LANE if (is_nan[l]) result = NAN;
    return result;
}

/* ---- cones ---- */

typedef struct {
    const int64_t *slabs;
    Py_ssize_t orthant, count, size, cones; /* slabs are so many, and the cones in all of them */
} Cones;

static int layout(Arguments *a, PyObject *object, Cones *c) {
    const int64_t *given = array(a, object, "ilqn", 8, ANY, 0);
    if (!given) return 0;
    Py_ssize_t count = a->views[a->count - 1].len / 8;
    int is_good = count % 2 && given[0] >= 0 && given[0] < LARGE;
    c->count = (count - 1) / 2, c->slabs = given + 1;
    c->orthant = c->size = is_good ? given[0] : 0, c->cones = 0;
    for (Py_ssize_t i = 0; is_good && i < c->count; i++) {
        int64_t d = c->slabs[2 * i], k = c->slabs[2 * i + 1];
        is_good = d > 0 && k >= 0 && (k == 0 || d < LARGE / k) && c->size + d * k < LARGE;
        if (is_good) c->size += d * k, c->cones += k;
    }
    if (!is_good) PyErr_SetString(PyExc_ValueError, "the sizes of cones were expected");
    return is_good;
}

#define LAYOUT \
    Cones c; \
    if (!layout(&a, args[0], &c)) goto fail
#define EACH_SLAB(at) \
    for (Py_ssize_t slab = 0, at = c.orthant, d, k; \
         slab < c.count && (d = c.slabs[2 * slab], k = c.slabs[2 * slab + 1], 1); at += d * k, slab++)

INLINE double tail(const double *u, const double *v, Py_ssize_t d, Py_ssize_t k) {
    double sum = 0.0;
    for (Py_ssize_t i = 1; i < d; i++) sum += u[i * k] * v[i * k];
    return sum;
}

INLINE double determinant(const double *u, Py_ssize_t d, Py_ssize_t k) {
    double norm = sqrt(tail(u, u, d, k));
    return (u[0] - norm) * (u[0] + norm);
}

static PyObject *product(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(4);
    LAYOUT;
    DOUBLES(u, 1, c.size);
    DOUBLES(v, 2, c.size);
    RESULT(out, 3, c.size);
    for (Py_ssize_t i = 0; i < c.orthant; i++) out[i] = u[i] * v[i];
    EACH_SLAB(at) for (Py_ssize_t j = at; j < at + k; j++) {
        double first = u[j] * v[j] + tail(u + j, v + j, d, k);
        for (Py_ssize_t i = 1; i < d; i++) out[j + i * k] = u[j] * v[j + i * k] + v[j] * u[j + i * k];
        out[j] = first;
    }
    END(NONE);
}

static PyObject *quotient(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(4);
    LAYOUT;
    DOUBLES(v, 1, c.size);
    DOUBLES(u, 2, c.size);
    RESULT(out, 3, c.size);
    for (Py_ssize_t i = 0; i < c.orthant; i++) out[i] = v[i] / u[i];
    EACH_SLAB(at) for (Py_ssize_t j = at; j < at + k; j++) {
        double first = (u[j] * v[j] - tail(u + j, v + j, d, k)) / determinant(u + j, d, k);
        for (Py_ssize_t i = 1; i < d; i++) out[j + i * k] = (v[j + i * k] - first * u[j + i * k]) / u[j];
        out[j] = first;
    }
    END(NONE);
}

INLINE double clip(double v, double low, double high) {
    return v < low ? low : v > high ? high : v;
}

static PyObject *clipped(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(5);
    LAYOUT;
    DOUBLES(u, 1, c.size);
    NUMBER(low, 2);
    NUMBER(high, 3);
    RESULT(out, 4, c.size);
    for (Py_ssize_t i = 0; i < c.orthant; i++) out[i] = clip(u[i], low, high);
    EACH_SLAB(at) for (Py_ssize_t j = at; j < at + k; j++) {
        double norm = sqrt(tail(u + j, u + j, d, k));
        double most = clip(u[j] + norm, low, high), least = clip(u[j] - norm, low, high);
        double share = 0.5 * (most - least) / (norm > 0.0 ? norm : 1.0);
        for (Py_ssize_t i = 1; i < d; i++) out[j + i * k] = share * u[j + i * k];
        out[j] = 0.5 * (most + least);
    }
    END(NONE);
}

WIDE static double least_eigenvalue(const Cones *cones, const double *u) {
    Cones c = *cones;
    Largest below = {.most = SPREAD(-INFINITY)};
    for (Py_ssize_t i = 0; i < c.orthant; i += LANES) compare(&below, -loaded(u, i, c.orthant));
    EACH_SLAB(at) for (Py_ssize_t j = 0; j < k; j += LANES) {
        Lanes head = loaded(u + at, j, k), square = {0.0};
        for (Py_ssize_t i = 1; i < d; i++) {
            Lanes one = loaded(u + at + i * k, j, k);
            square += one * one;
        }
        compare(&below, rooted(square) - head);
    }
    return -of_all(&below);
}

static PyObject *margin(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(2);
    LAYOUT;
    DOUBLES(u, 1, c.size);
    double least = least_eigenvalue(&c, u);
    END(PyFloat_FromDouble(least));
}

WIDE static double steepest(const Cones *cones, const double *u, const double *v) {
    Cones c = *cones;
    Largest worst = {.most = {0.0}};
    for (Py_ssize_t i = 0; i < c.orthant; i += LANES)
        compare(&worst, -loaded(v, i, c.orthant) / loaded(u, i, c.orthant));
    EACH_SLAB(at) for (Py_ssize_t j = 0; j < k; j += LANES) {
        const double *from = u + at, *along = v + at;
        Lanes head = loaded(from, j, k), ahead = loaded(along, j, k), square = {0.0}, cross = {0.0};
        for (Py_ssize_t i = 1; i < d; i++) {
            Lanes one = loaded(from + i * k, j, k);
            square += one * one, cross += one * loaded(along + i * k, j, k);
        }
        Lanes norm = rooted(square), unit = 1.0 / rooted((head - norm) * (head + norm));
        head *= unit, ahead *= unit;
        Lanes first = head * ahead - cross * unit * unit, share = (first + ahead) / (1.0 + head);
        square = (Lanes){0.0};
        for (Py_ssize_t i = 1; i < d; i++) {
            Lanes off = (loaded(along + i * k, j, k) - share * loaded(from + i * k, j, k)) * unit;
            square += off * off;
        }
        compare(&worst, rooted(square) - first);
    }
    return of_all(&worst);
}

/* The inverse of the longest step from u along v; 0 if there is none. */
static PyObject *shortest(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(3);
    LAYOUT;
    DOUBLES(u, 1, c.size);
    DOUBLES(v, 2, c.size);
    double worst = steepest(&c, u, v);
    END(PyFloat_FromDouble(worst));
}

/* ---- Nesterov-Todd scaling: of the orthant s / z, of every cone its size and w ---- */

static PyObject *scaling(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(6);
    LAYOUT;
    DOUBLES(s, 1, c.size);
    DOUBLES(z, 2, c.size);
    RESULT(plain, 3, c.orthant);
    RESULT(w, 4, c.size - c.orthant);
    RESULT(sizes, 5, c.cones);
    Py_ssize_t number = 0;
    int is_inside = least_eigenvalue(&c, s) > 0.0 && least_eigenvalue(&c, z) > 0.0;
    for (Py_ssize_t i = 0; is_inside && i < c.orthant; i++) plain[i] = s[i] / z[i];
    if (is_inside) EACH_SLAB(at) for (Py_ssize_t j = at; j < at + k; j++) {
        double *to = w + (j - c.orthant);
        double ds = sqrt(determinant(s + j, d, k)), dz = sqrt(determinant(z + j, d, k)), sum = 0.0;
        double cosine = (s[j] * z[j] + tail(s + j, z + j, d, k)) / ds / dz;
        double unit = sqrt(2.0 * (1.0 + cosine));
        for (Py_ssize_t i = 1; i < d; i++) {
            double own = (s[j + i * k] / ds - z[j + i * k] / dz) / unit;
            sum += own * own;
            to[i * k] = own;
        }
        to[0] = sqrt(1.0 + sum);
        sizes[number++] = sqrt(ds / dz);
    }
    END(PyBool_FromLong(is_inside));
}

#define SCALING \
    LAYOUT; \
    DOUBLES(plain, 1, c.orthant); \
    DOUBLES(w, 2, c.size - c.orthant); \
    DOUBLES(sizes, 3, c.cones); \
    DOUBLES(v, 4, c.size); \
    NUMBER(sign, 5); \
    RESULT(out, 6, c.size)

WIDE static void scaled_by(const Cones *cones, const double *plain, const double *w, const double *sizes,
                           const double *v, double sign, double *out) {
    Cones c = *cones;
    Py_ssize_t n = c.orthant;
    for (Py_ssize_t i = 0; i < n; i += LANES) {
        Lanes scale = rooted(loaded(plain, i, n)), own = loaded(v, i, n);
        store(out, i, n, sign > 0.0 ? own * scale : own / scale);
    }
    EACH_SLAB(at) {
        const double *axis = w + at - n, *from = v + at;
        for (Py_ssize_t j = 0; j < k; j += LANES) {
            Lanes head = loaded(axis, j, k), own = loaded(from, j, k), scale = loaded(sizes, j, k);
            Lanes cross = {0.0};
            for (Py_ssize_t i = 1; i < d; i++)
                cross += loaded(axis + i * k, j, k) * loaded(from + i * k, j, k);
            if (sign < 0.0) scale = 1.0 / scale, cross = -cross;
            Lanes share = sign * (own + cross / (1.0 + head));
            for (Py_ssize_t i = 1; i < d; i++)
                store(out + at + i * k, j, k,
                      scale * (loaded(from + i * k, j, k) + share * loaded(axis + i * k, j, k)));
            store(out + at, j, k, scale * (head * own + cross));
        }
        sizes += k;
    }
}

static PyObject *times(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(7);
    SCALING;
    scaled_by(&c, plain, w, sizes, v, sign, out);
    END(NONE);
}

static PyObject *squared(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(7);
    SCALING;
    Py_ssize_t number = 0;
    if (sign > 0.0)
        for (Py_ssize_t i = 0; i < c.orthant; i++) out[i] = v[i] * plain[i];
    else
        for (Py_ssize_t i = 0; i < c.orthant; i++) out[i] = v[i] / plain[i];
    EACH_SLAB(at) for (Py_ssize_t j = at; j < at + k; j++) {
        const double *own = w + (j - c.orthant);
        double size = sizes[number] * sizes[number], scale = sign > 0.0 ? size : 1.0 / size;
        double along = own[0] * v[j] + sign * tail(own, v + j, d, k);
        for (Py_ssize_t i = 1; i < d; i++)
            out[j + i * k] = scale * (2.0 * sign * along * own[i * k] + v[j + i * k]);
        out[j] = scale * (2.0 * along * own[0] - v[j]);
        number++;
    }
    END(NONE);
}

/* ---- sparse rows ---- */

#define ROWS \
    INTEGERS(int32_t, starts, 0, ANY); \
    Py_ssize_t rows = LENGTH - 1; \
    CHECK(rows >= 0 && starts[0] == 0, "rows were expected"); \
    INTEGERS(int32_t, columns, 1, starts[rows]); \
    DOUBLES(data, 2, starts[rows])
/* Rows in order, and columns below the width. It is asked of every product, hence without a branch: the
 * sign of a column, or of what is left beyond it. */
static int fits(const int32_t *starts, Py_ssize_t rows, const int32_t *columns, Py_ssize_t width) {
    uint32_t wrong = 0, last = (uint32_t)(width > INT32_MAX ? INT32_MAX : width - 1);
    for (Py_ssize_t i = 0; i < rows; i++)
        wrong |= (uint32_t)starts[i + 1] | ((uint32_t)starts[i + 1] - (uint32_t)starts[i]);
    for (int32_t k = 0, n = wrong >> 31 ? 0 : starts[rows]; k < n; k++)
        wrong |= (uint32_t)columns[k] | (last - (uint32_t)columns[k]);
    return !(wrong >> 31);
}

#define FITTING(width) CHECK(fits(starts, rows, columns, width), "columns beyond the vector")
#define EACH_ENTRY(i, j) for (int32_t j = starts[i]; j < starts[i + 1]; j++)

static PyObject *matvec(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(5);
    ROWS;
    DOUBLES(v, 3, ANY);
    FITTING(LENGTH);
    RESULT(out, 4, rows);
    for (Py_ssize_t i = 0; i < rows; i++) {
        double sum = 0.0;
        EACH_ENTRY(i, j) sum += data[j] * v[columns[j]];
        out[i] = sum;
    }
    END(NONE);
}

static PyObject *transposed_matvec(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(5);
    ROWS;
    DOUBLES(v, 3, rows);
    RESULT(out, 4, ANY); /* zeros */
    FITTING(LENGTH);
    for (Py_ssize_t i = 0; i < rows; i++) {
        double own = v[i];
        EACH_ENTRY(i, j) out[columns[j]] += data[j] * own;
    }
    END(NONE);
}

WIDE static double largest_size(const double *v, Py_ssize_t n) {
    Largest sizes = {.most = {0.0}};
    for (Py_ssize_t i = 0; i < n; i += LANES) {
        Lanes own = loaded(v, i, n);
        compare(&sizes, WITHOUT_SIGN(own));
    }
    return of_all(&sizes);
}

static PyObject *largest(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(1);
    DOUBLES(v, 0, ANY);
    double most = largest_size(v, LENGTH);
    END(PyFloat_FromDouble(most));
}

/* ---- groups of blocks: r cone rows, c variables, e equations each, LANES of the k at a time ---- */

typedef struct {
    Py_ssize_t r, c, k, plain;     /* linear rows come first */
    const double *diagonal;        /* s / z of the linear rows (plain, k) */
    const int64_t *slabs;          /* d, place of w, place of sizes, of every cone of a block */
    Py_ssize_t cones;
    const double *w, *sizes;
} Group;

/* rows (r, c) := W^-1 G of the tile of blocks from the first on. */
WIDE static void scaled(const Group *g, Py_ssize_t first, const Lanes *part, Lanes *rows) {
    Py_ssize_t r = g->plain, c = g->c, k = g->k;
    for (Py_ssize_t i = 0; i < r; i++) {
        Lanes scale = 1.0 / rooted(loaded(g->diagonal + i * k, first, k));
        for (Py_ssize_t j = 0; j < c; j++)
            rows[i * c + j] = part[i * c + j] * scale;
    }
    for (Py_ssize_t cone = 0; cone < g->cones; cone++) {
        Py_ssize_t d = g->slabs[3 * cone];
        const double *w = g->w + g->slabs[3 * cone + 1];
        Lanes scale = 1.0 / loaded(g->sizes + g->slabs[3 * cone + 2], first, k), axis = loaded(w, first, k);
        for (Py_ssize_t j = 0; j < c; j++) {
            const Lanes *own = part + r * c + j;
            Lanes head = own[0], cross = head * 0.0;
            for (Py_ssize_t i = 1; i < d; i++) cross += loaded(w + i * k, first, k) * own[i * c];
            Lanes along = cross / (1.0 + axis) - head;
            rows[r * c + j] = (axis * head - cross) * scale;
            for (Py_ssize_t i = 1; i < d; i++)
                rows[(r + i) * c + j] = (own[i * c] + along * loaded(w + i * k, first, k)) * scale;
        }
        r += d;
    }
}

/* root (c, c) with root' root the inverse of rows' rows, by Cholesky's factor of it, scaled to a unit
 * diagonal, and that factor's inverse; returns the least pivots, at most 1. */
WIDE static void inverted(Py_ssize_t r, Py_ssize_t c, double more, const Lanes *rows, Lanes *gram,
                          Lanes *root, double *pivots) {
    Lanes *scale = gram + c * c, least = rows[0] * 0.0 + 1.0, sum;
    for (Py_ssize_t i = 0; i < c; i++) {
        for (Py_ssize_t j = 0; j <= i; j++) {
            sum = rows[i] * rows[j];
            for (Py_ssize_t m = 1; m < r; m++) sum += rows[m * c + i] * rows[m * c + j];
            gram[i * c + j] = sum;
        }
        scale[i] = 1.0 / rooted(gram[i * c + i] * (1.0 + more));
    }
    for (Py_ssize_t i = 0; i < c; i++) {
        Lanes *own = gram + i * c, inverse;
        for (Py_ssize_t j = 0; j < i; j++) {
            sum = own[j] * scale[i] * scale[j];
            for (Py_ssize_t m = 0; m < j; m++) sum -= own[m] * gram[j * c + m];
            own[j] = sum * gram[j * c + j]; /* on the diagonal are inverses by now */
        }
        sum = scale[i] * 0.0 + (1.0 + more);
        for (Py_ssize_t m = 0; m < i; m++) sum -= own[m] * own[m];
        LANE OF(least) = OF(sum) >= OF(least) ? OF(least) : OF(sum); /* of NaN: NaN */
        own[i] = inverse = 1.0 / rooted(sum);
        for (Py_ssize_t j = 0; j < i; j++) {
            sum = own[j] * root[j * c + j];
            for (Py_ssize_t m = j + 1; m < i; m++) sum += own[m] * root[m * c + j];
            root[i * c + j] = -sum * inverse;
        }
        root[i * c + i] = inverse;
        for (Py_ssize_t j = i + 1; j < c; j++) root[i * c + j] = sum * 0.0;
    }
    for (Py_ssize_t i = 0; i < c; i++)
        for (Py_ssize_t j = 0; j <= i; j++) root[i * c + j] *= scale[j];
    LANE pivots[l] = OF(least);
}

/* The same of one block by Householder reflections of its rows (r, c), as in blocks.py: order, norms
 * (c,). What is ``left`` of the rows is lost; the root is written to one lane. */
static void reflected(Py_ssize_t r, Py_ssize_t c, double softest, double *left, Py_ssize_t *order,
                      double *least, Lanes *root, int l) {
    double *own = least + c; /* (c, c), the root with its columns in another order */
    for (Py_ssize_t j = 0; j < c; j++) {
        double sum = 0.0;
        for (Py_ssize_t m = 0; m < r; m++) sum += left[m * c + j] * left[m * c + j];
        least[j] = softest * sqrt(sum), order[j] = j;
    }
    for (Py_ssize_t i = 0; i < c; i++) {
        Py_ssize_t column = i, row = i;
        double most = -1.0, pivot;
        for (Py_ssize_t j = i; j < c; j++) {
            double sum = 0.0;
            for (Py_ssize_t m = i; m < r; m++) sum += left[m * c + j] * left[m * c + j];
            if (sum > most) most = sum, column = j;
        }
        Py_ssize_t other = order[i];
        order[i] = order[column], order[column] = other;
        for (Py_ssize_t m = 0; m < r; m++) {
            double kept = left[m * c + i];
            left[m * c + i] = left[m * c + column], left[m * c + column] = kept;
        }
        for (Py_ssize_t m = i; m < r; m++)
            if (fabs(left[m * c + i]) > fabs(left[row * c + i])) row = m;
        for (Py_ssize_t j = 0; j < c; j++) {
            double kept = left[i * c + j];
            left[i * c + j] = left[row * c + j], left[row * c + j] = kept;
        }
        pivot = 0.0;
        for (Py_ssize_t m = i; m < r; m++) pivot += left[m * c + i] * left[m * c + i];
        pivot = sqrt(pivot);
        pivot = -copysign(pivot > least[order[i]] ? pivot : least[order[i]], left[i * c + i]);
        left[i * c + i] -= pivot;
        for (Py_ssize_t j = i + 1; j < c; j++) {
            double share = 0.0;
            for (Py_ssize_t m = i; m < r; m++) share += left[m * c + i] * left[m * c + j];
            share /= pivot * left[i * c + i];
            for (Py_ssize_t m = i; m < r; m++) left[m * c + j] += share * left[m * c + i];
        }
        left[i * c + i] = pivot;
        for (Py_ssize_t j = 0; j < i; j++) {
            double sum = 0.0;
            for (Py_ssize_t m = j; m < i; m++) sum += left[m * c + i] * own[m * c + j];
            own[i * c + j] = -sum / pivot;
        }
        own[i * c + i] = 1.0 / pivot;
    }
    for (Py_ssize_t i = 0; i < c; i++)
        for (Py_ssize_t j = 0; j < c; j++) OF(root[i * c + order[j]]) = j <= i ? own[i * c + j] : 0.0;
}

static PyObject *roots(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(10);
    Lanes *room;
    Py_ssize_t *order;
    INTEGERS(int64_t, sizes, 0, 5); /* r, c, k, linear rows, first of these */
    /* Reflections need as many rows as columns. */
    CHECK(sizes[1] > 0 && sizes[0] >= sizes[1] && sizes[0] < SMALL && sizes[2] > 0 && sizes[2] < SMALL &&
              sizes[3] >= 0 && sizes[4] >= 0 && sizes[4] < LARGE, "a block of this size was not expected");
    Group g = {.r = sizes[0], .c = sizes[1], .k = sizes[2], .plain = sizes[3]};
    Py_ssize_t r = g.r, c = g.c, k = g.k;
    Py_ssize_t tiles = (k + LANES - 1) / LANES;
    DOUBLES(part, 1, r * c * tiles * LANES);
    DOUBLES(diagonal, 2, ANY);
    CHECK(g.plain <= r && LENGTH >= sizes[4] + g.plain * k, "a block of this size was not expected");
    INTEGERS(int64_t, slabs, 3, ANY);
    CHECK(LENGTH % 3 == 0, "cones of other sizes were expected");
    g.cones = LENGTH / 3;
    DOUBLES(w, 4, ANY);
    Py_ssize_t frames = LENGTH, rows = g.plain;
    DOUBLES(own, 5, ANY);
    for (Py_ssize_t i = 0; i < g.cones; i++) {
        int64_t d = slabs[3 * i], first = slabs[3 * i + 1], size = slabs[3 * i + 2];
        CHECK(d > 0 && d <= r - rows && first >= 0 && first <= frames - d * k && size >= 0 && size <= LENGTH - k,
              "cones of other sizes were expected");
        rows += d;
    }
    CHECK(rows == r, "cones of other sizes were expected");
    NUMBER(more, 6);
    NUMBER(hard, 7);
    NUMBER(softest, 8);
    RESULT(root, 9, c * c * tiles * LANES);
    g.diagonal = diagonal + sizes[4], g.slabs = slabs, g.w = w, g.sizes = own;
    room = malloc(sizeof(Lanes) * (r * c + c * c + c) + sizeof(double) * (r * c + c * c + c));
    order = malloc(sizeof(Py_ssize_t) * (c + 1));
    if (!room || !order) {
        free(room), free(order);
        NO_MEMORY;
    }
    double *alone = (double *)(room + r * c + c * c + c), least[LANES];
    for (Py_ssize_t tile = 0; tile < tiles; tile++) {
        Lanes *to = (Lanes *)root + tile * c * c;
        scaled(&g, tile * LANES, (const Lanes *)part + tile * r * c, room);
        inverted(r, c, more, room, room + r * c, to, least);
        LANE if (!(least[l] > hard)) {
            for (Py_ssize_t i = 0; i < r * c; i++) alone[i] = OF(room[i]);
            reflected(r, c, softest, alone, order, alone + r * c, to, l);
        }
    }
    free(room), free(order);
    END(NONE);
}

/* half (e, c) := E root', then its inner products, in the order (0, 0), (1, 0), (1, 1), (2, 0) ... */
WIDE static void products(Py_ssize_t c, Py_ssize_t e, const Lanes *root, const Lanes *part, Lanes *half,
                          Lanes *sums) {
    for (Py_ssize_t j = 0; j < e; j++) {
        Lanes *own = half + j * c, sum;
        for (Py_ssize_t i = 0; i < c; i++) {
            sum = root[i * c] * part[j * c];
            for (Py_ssize_t m = 1; m < c; m++) sum += root[i * c + m] * part[j * c + m];
            own[i] = sum;
        }
        for (const Lanes *other = half; other <= own; other += c) {
            sum = own[0] * other[0];
            for (Py_ssize_t i = 1; i < c; i++) sum += own[i] * other[i];
            *sums++ = sum;
        }
    }
}

static PyObject *add_squares(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(5);
    Lanes *room = NULL;
    INTEGERS(int64_t, sizes, 0, 3); /* c, e, tiles */
    for (int i = 0; i < 3; i++) CHECK(sizes[i] > 0 && sizes[i] < SMALL, "a block of this size was not expected");
    Py_ssize_t c = sizes[0], e = sizes[1], tiles = sizes[2], pairs = e * (e + 1) / 2;
    DOUBLES(root, 1, c * c * tiles * LANES);
    DOUBLES(part, 2, e * c * tiles * LANES);
    INTEGERS(int32_t, slots, 3, pairs * tiles * LANES); /* or -1 for what is left out */
    RESULT(data, 4, ANY);
    Py_ssize_t length = LENGTH;
    room = malloc(sizeof(Lanes) * (c * e + pairs));
    if (!room) NO_MEMORY;
    Lanes *sums = room + c * e;
    for (Py_ssize_t tile = 0; tile < tiles; tile++) {
        products(c, e, (const Lanes *)root + tile * c * c, (const Lanes *)part + tile * e * c, room, sums);
        const int32_t *at = slots + tile * pairs * LANES;
        for (Py_ssize_t pair = 0; pair < pairs; pair++)
            LANE {
                int32_t slot = at[pair * LANES + l];
                if (slot >= 0 && slot < length) data[slot] += OF(sums[pair]);
            }
    }
    free(room);
    END(NONE);
}

/* out := root' root v of one tile, for v (c, k) */
WIDE static void applied(Py_ssize_t c, Py_ssize_t k, Py_ssize_t first, const Lanes *root, const double *v,
                         Lanes *given, double *out) {
    Lanes *result = given + c;
    for (Py_ssize_t j = 0; j < c; j++) given[j] = loaded(v + j * k, first, k), result[j] = given[j] * 0.0;
    for (Py_ssize_t i = 0; i < c; i++) {
        Lanes half = root[i * c] * given[0];
        for (Py_ssize_t j = 1; j < c; j++) half += root[i * c + j] * given[j];
        for (Py_ssize_t j = 0; j < c; j++) result[j] += root[i * c + j] * half;
    }
    for (Py_ssize_t j = 0; j < c; j++) store(out + j * k, first, k, result[j]);
}

static PyObject *local(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(4);
    Lanes *room = NULL;
    INTEGERS(int64_t, sizes, 0, 3); /* c, k, first of them in v */
    Py_ssize_t c = sizes[0], k = sizes[1], first = sizes[2], tiles = (k + LANES - 1) / LANES;
    CHECK(c > 0 && c < SMALL && k > 0 && k < SMALL && first >= 0 && first < LARGE,
          "a block of this size was not expected");
    DOUBLES(root, 1, c * c * tiles * LANES);
    DOUBLES(v, 2, ANY);
    CHECK(LENGTH >= first + c * k, "a longer array was expected");
    RESULT(out, 3, ANY);
    CHECK(LENGTH >= first + c * k, "a longer array was expected");
    room = malloc(sizeof(Lanes) * 2 * c);
    if (!room) NO_MEMORY;
    for (Py_ssize_t tile = 0; tile < tiles; tile++)
        applied(c, k, tile * LANES, (const Lanes *)root + tile * c * c, v + first, room, out + first);
    free(room);
    END(NONE);
}

static int compared(const void *a, const void *b) {
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

/* Lower half of the n equations' Schur complement, by columns: each block fills the square of its own
 * equations (k, e) of every group, those below n, and every diagonal entry is there. Slots (k, e (e + 1)
 * / 2) say where each pair's product goes, -1 for none. Returns the number of entries. */
static PyObject *pattern(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(5);
    int64_t *start = NULL, *by_column = NULL, *mark = NULL;
    INTEGERS(int64_t, shapes, 0, ANY); /* k and e of every group */
    int64_t groups = LENGTH / 2, count = 0, pairs = 0, place = 0;
    for (int64_t g = 0; g < groups; g++) {
        int64_t k = shapes[2 * g], e = shapes[2 * g + 1];
        CHECK(k >= 0 && k < SMALL && e >= 0 && e < SMALL, "the sizes of groups were expected");
        place += k * e, pairs += k * e * (e + 1) / 2;
        CHECK(pairs < INT32_MAX, "more pairs of equations than can be counted");
    }
    INTEGERS(int64_t, at, 1, place);
    WRITTEN(int64_t, indptr, 2, ANY);
    int64_t n = LENGTH - 1;
    CHECK(n >= 0 && n < INT32_MAX - pairs, "columns were expected");
    WRITTEN(int64_t, indices, 3, pairs + n);
    WRITTEN(int32_t, slots, 4, pairs);
    start = calloc(n + 2, 8), by_column = malloc(16 * (pairs + 1)), mark = malloc(8 * (n + 1));
    if (!start || !by_column || !mark) {
        free(start), free(by_column), free(mark);
        NO_MEMORY;
    }
#define EACH_PAIR(code) \
    do { \
        const int64_t *own = at; \
        int64_t pair = 0; \
        for (int64_t g = 0; g < groups; g++) \
            for (int64_t block = 0, e = shapes[2 * g + 1]; block < shapes[2 * g]; block++, own += e) \
                for (int64_t i = 0; i < e; i++) \
                    for (int64_t j = 0; j <= i; j++, pair++) { \
                        int64_t low = own[i] < own[j] ? own[i] : own[j]; \
                        int64_t high = own[i] < own[j] ? own[j] : own[i]; \
                        slots[pair] = -1; \
                        if (low >= 0 && high < n) code; \
                    } \
    } while (0)
    EACH_PAIR(start[low + 2]++);
    for (int64_t j = 0; j < n; j++) start[j + 2] += start[j + 1];
    EACH_PAIR((by_column[2 * start[low + 1]] = high, by_column[2 * start[low + 1]++ + 1] = pair));
    for (int64_t j = 0; j < n; j++) mark[j] = -1;
    for (int64_t j = 0; j < n; j++) {
        int64_t first = indptr[j] = count;
        indices[count++] = j, mark[j] = j;
        for (int64_t p = start[j]; p < start[j + 1]; p++) {
            int64_t row = by_column[2 * p];
            if (mark[row] != j) mark[row] = j, indices[count++] = row;
        }
        qsort(indices + first, count - first, 8, compared);
        for (int64_t p = first; p < count; p++) mark[indices[p]] = -2 - p;
        for (int64_t p = start[j]; p < start[j + 1]; p++)
            slots[by_column[2 * p + 1]] = (int32_t)(-2 - mark[by_column[2 * p]]);
    }
    indptr[n] = count;
    free(start), free(by_column), free(mark);
    END(PyLong_FromLongLong(count));
}

static PyMethodDef functions[] = {
    FUNCTION(product), FUNCTION(quotient),    FUNCTION(clipped), FUNCTION(margin), FUNCTION(shortest),
    FUNCTION(scaling), FUNCTION(times),       FUNCTION(squared), FUNCTION(matvec), FUNCTION(largest),
    FUNCTION(roots),   FUNCTION(add_squares), FUNCTION(local),   FUNCTION(pattern), FUNCTION(transposed_matvec),
    NO_FUNCTION,
};

MODULE(_batch, functions)
