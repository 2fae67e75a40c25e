/* Supernodal left-looking Cholesky of sparse matrices of one pattern, in the order given.
 *
 * A supernode is a run of columns whose factors have the same rows below; it is stored as one dense
 * panel, column by column. Contacts tie whole masonry blocks to each other, six equations each, so
 * that panels are wide. Formulas: Y. Chen, T. A. Davis, W. W. Hager, S. Rajamanickam, Algorithm 887:
 * CHOLMOD, 2008, section 3. */

#include "dense.h"

#define NARROW 12  /* supernodes are merged with the next one up to so many columns, */
#define ZEROS 0.15 /* or where no more than this share of the panel are zeros */

typedef struct {
    Py_ssize_t n, count, entries, tallest, widest;
    Py_ssize_t *first;   /* (count + 1,) columns */
    Py_ssize_t *start;   /* (count + 1,) rows of a panel in ``rows``: its own columns, then those below */
    Py_ssize_t *panel;   /* (count + 1,) places of panels in ``values`` */
    Py_ssize_t *rows, *place, *owner; /* place (entries,) of the matrix's entries, owner (n,) */
    double *values;
    Py_ssize_t *links;   /* rooms of elimination, */
    double *update, *packs, *below; /* and of solutions */
} Factor;

static void freed(Factor *f) {
    free(f->first), free(f->start), free(f->panel), free(f->rows), free(f->place), free(f->owner);
    free(f->values), free(f->links), free(f->update), free(f->packs), free(f->below), free(f);
}

/* Elimination tree of a matrix whose lower half is given by columns (J. W. H. Liu, 1990). All are rooms for
 * n numbers. */
static void set_tree(Py_ssize_t n, const int64_t *indptr, const int64_t *indices, Py_ssize_t *parent,
                     Py_ssize_t *head, Py_ssize_t *next, Py_ssize_t *oldest, Py_ssize_t *list) {
    /* Rows are visited in order: entries of each row are linked by the column in which they stand. */
    Py_ssize_t *at = head; /* the next entry of a column that has not been visited */
    for (Py_ssize_t j = 0; j < n; j++) parent[j] = oldest[j] = next[j] = -1, at[j] = indptr[j];
    for (Py_ssize_t j = 0; j < n; j++) list[j] = -1;
    for (Py_ssize_t i = 0; i < n; i++) {
        if (at[i] < indptr[i + 1] && indices[at[i]] == i) at[i]++;
        for (Py_ssize_t j = list[i], after; j >= 0; j = after) {
            after = next[j];
            for (Py_ssize_t k = j, up; k != i && k >= 0; k = up) {
                up = oldest[k];
                oldest[k] = i;
                if (up < 0) {
                    parent[k] = i;
                    break;
                }
            }
            if (++at[j] < indptr[j + 1]) next[j] = list[indices[at[j]]], list[indices[at[j]]] = j;
        }
        if (at[i] < indptr[i + 1]) next[i] = list[indices[at[i]]], list[indices[at[i]]] = i;
    }
}

static int compared(const void *a, const void *b) {
    Py_ssize_t x = *(const Py_ssize_t *)a, y = *(const Py_ssize_t *)b;
    return (x > y) - (x < y);
}

/* Rows of every column's factor; structs[j] (sizes[j],) are below the diagonal, sorted. */
static int set_structure(Py_ssize_t n, const int64_t *indptr, const int64_t *indices,
                         const Py_ssize_t *parent, Py_ssize_t **structs, Py_ssize_t *sizes,
                         Py_ssize_t *child, Py_ssize_t *sibling, Py_ssize_t *mark) {
    for (Py_ssize_t j = 0; j < n; j++) child[j] = sibling[j] = mark[j] = -1, structs[j] = NULL;
    for (Py_ssize_t j = n - 1; j >= 0; j--)
        if (parent[j] >= 0) sibling[j] = child[parent[j]], child[parent[j]] = j;
    for (Py_ssize_t j = 0; j < n; j++) {
        Py_ssize_t most = indptr[j + 1] - indptr[j], size = 0;
        for (Py_ssize_t c = child[j]; c >= 0; c = sibling[c]) most += sizes[c];
        Py_ssize_t *own = structs[j] = malloc(sizeof(Py_ssize_t) * (most + 1)), in_order = 0;
        if (!own) return 0;
        mark[j] = j;
        for (Py_ssize_t c = child[j]; c >= 0; c = sibling[c]) {
            for (Py_ssize_t k = 0; k < sizes[c]; k++)
                if (mark[structs[c][k]] != j) mark[structs[c][k]] = j, own[size++] = structs[c][k];
            if (c == child[j]) in_order = size;
        }
        for (Py_ssize_t k = indptr[j]; k < indptr[j + 1]; k++)
            if (mark[indices[k]] != j) mark[indices[k]] = j, own[size++] = indices[k];
        if (in_order < size) qsort(own, size, sizeof(Py_ssize_t), compared);
        sizes[j] = size;
        own = realloc(structs[j], sizeof(Py_ssize_t) * (size + 1));
        if (own) structs[j] = own;
    }
    return 1;
}

/* Runs of columns that become one panel: the first of each, and -1 at the end. */
static Py_ssize_t merged(Py_ssize_t n, const Py_ssize_t *parent, const Py_ssize_t *sizes,
                         Py_ssize_t *first) {
    Py_ssize_t count = 0;
    double kept = 0.0; /* entries of the run's columns that are no zeros */
    for (Py_ssize_t j = 0; j < n; j++) {
        if (j > 0 && parent[j - 1] == j) {
            /* The run with j: its rows are those of j, below all its columns. */
            Py_ssize_t width = j + 1 - first[count - 1];
            double area = 0.5 * width * (width + 1.0) + (double)width * sizes[j];
            double zeros = area - kept - sizes[j] - 1.0;
            if (zeros <= 0.0 || width <= NARROW || zeros < ZEROS * area) {
                kept += sizes[j] + 1.0;
                continue;
            }
        }
        first[count++] = j;
        kept = sizes[j] + 1.0;
    }
    first[count] = n;
    return count;
}

static Factor *analysis(Py_ssize_t n, Py_ssize_t entries, const int64_t *indptr, const int64_t *indices) {
    Factor *f = calloc(1, sizeof(Factor));
    Py_ssize_t *room = malloc(sizeof(Py_ssize_t) * (6 * n + 1)), *sizes = room ? room + 5 * n : NULL;
    Py_ssize_t **structs = calloc(n + 1, sizeof(Py_ssize_t *));
    int is_good = f && room && structs;
    if (is_good) {
        f->n = n, f->entries = entries;
        f->first = malloc(sizeof(Py_ssize_t) * (n + 1)), f->owner = malloc(sizeof(Py_ssize_t) * (n + 1));
        f->place = malloc(sizeof(Py_ssize_t) * (entries + 1));
        is_good = f->first && f->owner && f->place;
    }
    if (is_good) {
        set_tree(n, indptr, indices, room, room + n, room + 2 * n, room + 3 * n, room + 4 * n);
        is_good = set_structure(n, indptr, indices, room, structs, sizes, room + n, room + 2 * n, room + 3 * n);
    }
    if (is_good) {
        f->count = merged(n, room, sizes, f->first);
        f->start = calloc(f->count + 1, sizeof(Py_ssize_t)), f->panel = calloc(f->count + 1, sizeof(Py_ssize_t));
        is_good = f->start && f->panel;
    }
    for (Py_ssize_t s = 0; is_good && s < f->count; s++) {
        Py_ssize_t width = f->first[s + 1] - f->first[s], height = width + sizes[f->first[s + 1] - 1];
        f->start[s + 1] = f->start[s] + height;
        f->panel[s + 1] = f->panel[s] + height * width;
        f->tallest = height > f->tallest ? height : f->tallest;
        f->widest = width > f->widest ? width : f->widest;
    }
    if (is_good) {
        f->rows = malloc(sizeof(Py_ssize_t) * (f->start[f->count] + 1));
        f->values = malloc(sizeof(double) * (f->panel[f->count] + LANES)); /* as many may be read beyond */
        f->links = malloc(sizeof(Py_ssize_t) * (3 * f->count + n + 1));
        f->update = malloc(sizeof(double) * (f->tallest * f->widest + 1));
        f->packs = malloc(sizeof(double) * DEEP * (f->widest + BROAD + TALL));
        f->below = malloc(sizeof(double) * (f->tallest + 1));
        is_good = f->rows && f->values && f->links && f->update && f->packs && f->below;
    }
    for (Py_ssize_t s = 0; is_good && s < f->count; s++) {
        Py_ssize_t from = f->first[s], to = f->first[s + 1], height = f->start[s + 1] - f->start[s];
        Py_ssize_t *rows = f->rows + f->start[s], *map = room; /* the tree is not needed any more */
        for (Py_ssize_t j = from; j < to; j++) rows[j - from] = j, f->owner[j] = s;
        if (height > to - from) memcpy(rows + to - from, structs[to - 1], sizeof(Py_ssize_t) * sizes[to - 1]);
        for (Py_ssize_t i = 0; i < height; i++) map[rows[i]] = i;
        for (Py_ssize_t j = from; j < to; j++)
            for (Py_ssize_t k = indptr[j]; k < indptr[j + 1]; k++)
                f->place[k] = f->panel[s] + (j - from) * height + map[indices[k]];
    }
    for (Py_ssize_t j = 0; structs && j < n; j++) free(structs[j]);
    free(structs), free(room);
    if (f && !is_good) freed(f), f = NULL;
    return f;
}

static void emptied(Factor *f) { memset(f->values, 0, sizeof(double) * f->panel[f->count]); }

/* The factor of the matrix whose entries are in their places; 0 if it is not positive definite. */
static int numeric(Factor *f) {
    Py_ssize_t *head = f->links, *next = head + f->count, *at = next + f->count, *map = at + f->count;
    for (Py_ssize_t s = 0; s < f->count; s++) head[s] = -1;
    for (Py_ssize_t s = 0; s < f->count; s++) {
        Py_ssize_t from = f->first[s], to = f->first[s + 1], width = to - from;
        const Py_ssize_t *rows = f->rows + f->start[s];
        Py_ssize_t height = f->start[s + 1] - f->start[s];
        double *L = f->values + f->panel[s];
        for (Py_ssize_t i = 0; i < height; i++) map[rows[i]] = i;
        for (Py_ssize_t d = head[s], after; d >= 0; d = after) {
            after = next[d];
            const Py_ssize_t *below = f->rows + f->start[d];
            Py_ssize_t tall = f->start[d + 1] - f->start[d], broad = f->first[d + 1] - f->first[d];
            Py_ssize_t here = at[d], end = here;
            while (end < tall && below[end] < to) end++;
            const double *own = f->values + f->panel[d] + here;
            Py_ssize_t m = tall - here, n = end - here;
            multiplied(m, n, broad, own, tall, own, tall, f->update, m, SET, f->packs);
            for (Py_ssize_t j = 0; j < n; j++) {
                double *column = L + (below[here + j] - from) * height;
                const double *less = f->update + j * m;
                for (Py_ssize_t i = j; i < m; i++) column[map[below[here + i]]] -= less[i];
            }
            if (end < tall) {
                Py_ssize_t goal = f->owner[below[end]];
                at[d] = end, next[d] = head[goal], head[goal] = d;
            }
        }
        if (!eliminated(height, width, L, height, f->packs)) return 0;
        if (height > width) {
            Py_ssize_t goal = f->owner[rows[width]];
            at[s] = width, next[s] = head[goal], head[goal] = s;
        }
    }
    return 1;
}

WIDE static void forward(const Factor *f, double *x) {
    double *y = f->below;
    for (Py_ssize_t s = 0; s < f->count; s++) {
        Py_ssize_t from = f->first[s], width = f->first[s + 1] - from;
        const Py_ssize_t *rows = f->rows + f->start[s] + width;
        Py_ssize_t height = f->start[s + 1] - f->start[s], below = height - width;
        const double *L = f->values + f->panel[s];
        memset(y, 0, sizeof(double) * below);
        for (Py_ssize_t j = 0; j < width; j++) {
            const double *own = L + j * height;
            double value = x[from + j] / own[j];
            x[from + j] = value;
            for (Py_ssize_t i = j + 1; i < width; i++) x[from + i] -= own[i] * value;
            for (Py_ssize_t i = 0; i < below; i++) y[i] += own[width + i] * value;
        }
        for (Py_ssize_t i = 0; i < below; i++) x[rows[i]] -= y[i];
    }
}

WIDE static void backward(const Factor *f, double *x) {
    double *y = f->below;
    for (Py_ssize_t s = f->count - 1; s >= 0; s--) {
        Py_ssize_t from = f->first[s], width = f->first[s + 1] - from;
        const Py_ssize_t *rows = f->rows + f->start[s] + width;
        Py_ssize_t height = f->start[s + 1] - f->start[s], below = height - width;
        const double *L = f->values + f->panel[s];
        for (Py_ssize_t i = 0; i < below; i++) y[i] = x[rows[i]];
        for (Py_ssize_t j = width - 1; j >= 0; j--) {
            const double *own = L + j * height, *under = own + width;
            double sums[4] = {0.0, 0.0, 0.0, 0.0}, sum = x[from + j];
            Py_ssize_t i = 0;
            for (; i + 4 <= below; i += 4)
                for (int t = 0; t < 4; t++) sums[t] += under[i + t] * y[i + t];
            for (; i < below; i++) sum -= under[i] * y[i];
            for (i = j + 1; i < width; i++) sum -= own[i] * x[from + i];
            x[from + j] = (sum - (sums[0] + sums[1] + sums[2] + sums[3])) / own[j];
        }
    }
}
