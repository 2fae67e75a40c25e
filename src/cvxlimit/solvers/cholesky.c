/* Sparse Cholesky factors for Python, sparse.h does the work: a factor is a capsule. */

#include "sparse.h"

static void forgotten(PyObject *capsule) {
    freed(PyCapsule_GetPointer(capsule, "factor"));
}

static PyObject *analysed(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(2);
    INTEGERS(int64_t, indptr, 0, ANY);
    Py_ssize_t n = LENGTH - 1;
    CHECK(n >= 0 && indptr[0] == 0, "columns were expected");
    INTEGERS(int64_t, indices, 1, indptr[n]);
    for (Py_ssize_t j = 0; j < n; j++) CHECK(indptr[j] <= indptr[j + 1], "columns were expected");
    for (Py_ssize_t j = 0; j < n; j++)
        for (Py_ssize_t k = indptr[j]; k < indptr[j + 1]; k++)
            CHECK(indices[k] >= j && indices[k] < n && (k == indptr[j] || indices[k] > indices[k - 1]),
                  "the lower half was expected, rows in order");
    Factor *f = analysis(n, indptr[n], indptr, indices);
    if (!f) NO_MEMORY;
    PyObject *capsule = PyCapsule_New(f, "factor", forgotten);
    if (!capsule) {
        freed(f);
        goto fail;
    }
    END(capsule);
}

#define FACTOR \
    Factor *f = PyCapsule_GetPointer(args[0], "factor"); \
    if (!f) goto fail

static PyObject *factorised(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(2);
    FACTOR;
    DOUBLES(data, 1, f->entries);
    emptied(f);
    for (Py_ssize_t k = 0; k < f->entries; k++) f->values[f->place[k]] = data[k];
    if (!numeric(f)) {
        PyErr_SetString(PyExc_ArithmeticError, "the matrix is not positive definite");
        goto fail;
    }
    END(NONE);
}

static PyObject *solution(PyObject *self, PyObject *const *args, Py_ssize_t given) {
    BEGIN(2);
    FACTOR;
    RESULT(x, 1, f->n);
    forward(f, x);
    backward(f, x);
    END(NONE);
}

static PyMethodDef functions[] = {
    FUNCTION(analysed), FUNCTION(factorised), FUNCTION(solution), NO_FUNCTION,
};

MODULE(_cholesky, functions)
