/* What the compiled parts share: arguments, checked for size, for what is wrong here would be a crash;
 * and for which processors loops are compiled. Arrays are contiguous. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define MOST 16          /* arguments of a function */
#define LARGE (1LL << 40) /* beyond what any memory holds: products of sizes below it do not overflow */

#ifndef SOURCES
#define SOURCES "" /* a digest of all C that this is built from: sources.py says why */
#endif

/* Several numbers at a time: vectors of GCC and Clang, or single numbers (MSVC, or -DNO_VECTORS), of which
 * the same expressions are made. */
#if defined(__GNUC__) && !defined(NO_VECTORS)
#define LANES 4
typedef double Lanes __attribute__((vector_size(32), aligned(8)));
typedef int64_t Mask __attribute__((vector_size(32))); /* of lanes: 0 or -1 */
#define SPREAD(x) ((Lanes){(x), (x), (x), (x)})
#define TOTAL(lanes) ((lanes)[0] + (lanes)[1] + (lanes)[2] + (lanes)[3])
#define WITHOUT_SIGN(lanes) ((Lanes)((Mask)(lanes) & INT64_MAX))
#else
#define LANES 1
typedef double Lanes;
typedef int64_t Mask;
#define SPREAD(x) (x)
#define TOTAL(lanes) (lanes)
#define WITHOUT_SIGN(lanes) fabs(lanes)
#endif
#define LANE for (int l = 0; l < LANES; l++)
#define OF(lanes) ((double *)&(lanes))[l]

#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) /* whose checks begin after versions are chosen */
#define WIDE __attribute__((target_clones("default", "fma")))
#else
#define WIDE
#endif

#define PRAGMA(words) _Pragma(#words)
#if defined(__clang__)
#define UNROLLED(times) PRAGMA(unroll times)
#elif defined(__GNUC__)
#define UNROLLED(times) PRAGMA(GCC unroll times)
#else
#define UNROLLED(times)
#endif
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wpsabi" /* vectors are arguments of what is inlined only */
#endif

#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#elif defined(_MSC_VER)
#define INLINE static __forceinline
#else
#define INLINE static inline
#endif

typedef struct {
    Py_buffer views[MOST];
    int count;
} Arguments;

static void release(Arguments *a) {
    while (a->count) PyBuffer_Release(&a->views[--a->count]);
}

#define ANY (-1) /* size */

/* A contiguous array of so many entries of so many bytes, of one of these kinds in Python's letters. */
static void *array(Arguments *a, PyObject *object, const char *kinds, Py_ssize_t item, Py_ssize_t size, int writes) {
    Py_buffer *view = &a->views[a->count];
    int flags = PyBUF_FORMAT | (writes ? PyBUF_CONTIG : PyBUF_CONTIG_RO);
    if (PyObject_GetBuffer(object, view, flags) < 0) return NULL;
    a->count++;
    int is_kind = view->format && view->format[0] && !view->format[1] && strchr(kinds, view->format[0]);
    if (!is_kind || view->itemsize != item || (size != ANY && (size < 0 || view->len / item != size))) {
        PyErr_Format(PyExc_ValueError, "%zd entries of %zd bytes where %zd of %zd were expected",
                     view->len / view->itemsize, view->itemsize, size, item);
        return NULL;
    }
    return view->buf;
}

/* Entries of the last array that was taken. */
#define LENGTH (a.views[a.count - 1].len / a.views[a.count - 1].itemsize)

#define DOUBLES(name, i, size) \
    const double *name = array(&a, args[i], "d", 8, size, 0); \
    if (!name) goto fail
#define RESULT(name, i, size) \
    double *name = array(&a, args[i], "d", 8, size, 1); \
    if (!name) goto fail
#define INTEGERS(type, name, i, size) \
    const type *name = array(&a, args[i], "ilqn", sizeof(type), size, 0); \
    if (!name) goto fail
#define WRITTEN(type, name, i, size) \
    type *name = array(&a, args[i], "ilqn", sizeof(type), size, 1); \
    if (!name) goto fail
#define CHECK(condition, said) \
    if (!(condition)) { \
        PyErr_SetString(PyExc_ValueError, said); \
        goto fail; \
    }
#define NUMBER(name, i) \
    double name = PyFloat_AsDouble(args[i]); \
    if (PyErr_Occurred()) goto fail
#define NO_MEMORY \
    do { \
        PyErr_NoMemory(); \
        goto fail; \
    } while (0)
#define BEGIN(wanted) \
    Arguments a = {.count = 0}; \
    if (given != wanted) { \
        PyErr_SetString(PyExc_TypeError, "wrong number of arguments"); \
        return NULL; \
    }
#define END(value) \
    release(&a); \
    return value; \
    fail: release(&a); \
    return NULL
#define NONE (Py_INCREF(Py_None), Py_None)

#define FUNCTION(name) {#name, (PyCFunction)(void (*)(void))name, METH_FASTCALL, NULL}
#define NO_FUNCTION {NULL, NULL, 0, NULL}

/* The module ``name`` with these functions, in the stable interface. */
#define MODULE(name, functions) \
    static int prepared(PyObject *module) { \
        if (PyModule_AddIntConstant(module, "LANES", LANES) < 0) return -1; \
        return PyModule_AddStringConstant(module, "SOURCES", SOURCES); \
    } \
    static PyModuleDef_Slot parts[] = {{Py_mod_exec, prepared}, {0, NULL}}; \
    static struct PyModuleDef definition = { \
        PyModuleDef_HEAD_INIT, #name, NULL, 0, functions, parts, NULL, NULL, NULL, \
    }; \
    PyMODINIT_FUNC PyInit_##name(void) { \
        return PyModuleDef_Init(&definition); \
    }
