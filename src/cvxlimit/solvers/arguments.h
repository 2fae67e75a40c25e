/* What the compiled parts share: arguments, checked for size, for what is wrong here would be a crash;
 * and for which processors loops are compiled. Arrays are contiguous. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define REVISION 3 /* of the interfaces: extensions.py asks for it */
#define MOST 16 /* arguments of a function */

#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define WIDE __attribute__((target_clones("default", "fma")))
#else
#define WIDE
#endif

#define INLINE static inline __attribute__((always_inline))
#pragma GCC diagnostic ignored "-Wpsabi" /* vectors are arguments of what is inlined only */

typedef struct {
    Py_buffer views[MOST];
    int count;
} Arguments;

static void release(Arguments *a) {
    while (a->count) PyBuffer_Release(&a->views[--a->count]);
}

static void *array(Arguments *a, PyObject *object, Py_ssize_t item, Py_ssize_t size, int writes) {
    Py_buffer *view = &a->views[a->count];
    if (PyObject_GetBuffer(object, view, writes ? PyBUF_CONTIG : PyBUF_CONTIG_RO) < 0) return NULL;
    a->count++;
    if (view->itemsize != item || (size >= 0 && view->len != size * item)) {
        PyErr_Format(PyExc_ValueError, "an array of %zd bytes where %zd entries of %zd were expected",
                     view->len, size, item);
        return NULL;
    }
    return view->buf;
}

#define DOUBLES(name, i, size) \
    const double *name = array(&a, args[i], 8, size, 0); \
    if (!name) goto fail
#define RESULT(name, i, size) \
    double *name = array(&a, args[i], 8, size, 1); \
    if (!name) goto fail
#define INTEGERS(type, name, i, size) \
    const type *name = array(&a, args[i], sizeof(type), size, 0); \
    if (!name) goto fail
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
        return PyModule_AddIntConstant(module, "REVISION", REVISION); \
    } \
    static PyModuleDef_Slot parts[] = {{Py_mod_exec, prepared}, {0, NULL}}; \
    static struct PyModuleDef definition = { \
        PyModuleDef_HEAD_INIT, #name, NULL, 0, functions, parts, NULL, NULL, NULL, \
    }; \
    PyMODINIT_FUNC PyInit_##name(void) { \
        return PyModuleDef_Init(&definition); \
    }
