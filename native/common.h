/* What all kernels need of Python: buffers and sizes, checked before they are used. */
#ifndef UAVRT_COMMON_H
#define UAVRT_COMMON_H

#define Py_LIMITED_API 0x030B0000
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined(__aarch64__)
#define BUILT_FOR "aarch64"
#elif defined(__x86_64__)
#define BUILT_FOR "x86-64"
#else
#define BUILT_FOR "this processor"
#endif
#define INLINE static inline __attribute__((always_inline))

/* Buffers of Python that a call holds; `release` gives all back. */
typedef struct {
    Py_buffer view[12];
    int count;
} buffers_t;

static void release(buffers_t *held)
{
    while (held->count)
        PyBuffer_Release(&held->view[--held->count]);
}

/* Hold a contiguous buffer of at least `least` items of `size` bytes; NULL and an error if it
   is none. `items` becomes how many it has. */
static void *hold(buffers_t *held, PyObject *object, int writable, Py_ssize_t size,
                  Py_ssize_t least, Py_ssize_t *items, const char *name)
{
    int flags = writable ? PyBUF_WRITABLE | PyBUF_C_CONTIGUOUS : PyBUF_C_CONTIGUOUS;
    Py_buffer *view = &held->view[held->count];
    if (PyObject_GetBuffer(object, view, flags) < 0)
        return NULL;
    held->count++;
    if (view->itemsize != size || least < 0 || view->len / size < least) {
        PyErr_Format(PyExc_ValueError, "%s: %zd bytes in items of %zd; needed are %zd of %zd",
                     name, view->len, view->itemsize, least, size);
        return NULL;
    }
    if (items != NULL)
        *items = view->len / size;
    return view->buf;
}

/* Whole numbers among the arguments; -1 and an error if one is none. */
static int get_sizes(PyObject *const *args, Py_ssize_t *values, int count)
{
    for (int i = 0; i < count; i++) {
        values[i] = PyLong_AsSsize_t(args[i]);
        if (values[i] == -1 && PyErr_Occurred())
            return -1;
    }
    return 0;
}

/* Whether a product of sizes, none negative, is below 2^40: no index of it overflows. */
static int fits(Py_ssize_t a, Py_ssize_t b)
{
    const Py_ssize_t most = (Py_ssize_t)1 << 40;
    return a >= 0 && b >= 0 && a <= most && b <= most && (b == 0 || a <= most / b);
}

static int count_is(Py_ssize_t given, Py_ssize_t wanted, const char *name)
{
    if (given == wanted)
        return 1;
    PyErr_Format(PyExc_TypeError, "%s takes %zd arguments, not %zd", name, wanted, given);
    return 0;
}

#endif
