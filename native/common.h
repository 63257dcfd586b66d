/* What all kernels need: vectors, versions for newer processors, buffers of Python.

   Plain C with the vector extensions of GCC and Clang: the same source for x86-64 and aarch64.
   On x86-64 with glibc the dynamic linker takes the version for the processor at hand. */
#ifndef UAVRT_COMMON_H
#define UAVRT_COMMON_H

#define Py_LIMITED_API 0x030B0000
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define LANES 16
typedef float lanes_t __attribute__((vector_size(64), aligned(4), may_alias));
typedef float four_t __attribute__((vector_size(16), aligned(4), may_alias));
typedef int32_t choice_t __attribute__((vector_size(64)));
typedef int32_t choice_four_t __attribute__((vector_size(16)));

#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__clang__) && __GNUC__ >= 12
#define VERSIONS __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define VERSIONS
#endif
#if defined(__aarch64__)
#define BUILT_FOR "aarch64"
#elif defined(__x86_64__)
#define BUILT_FOR "x86-64"
#else
#define BUILT_FOR "this processor"
#endif
#define INLINE static inline __attribute__((always_inline))

#define LOAD(at) (*(const lanes_t *)(at))
#define STORE(at, value) (*(lanes_t *)(at) = (value))
#define LOAD4(at) (*(const four_t *)(at))
#define STORE4(at, value) (*(four_t *)(at) = (value))

#if defined(__clang__)
#define SHUFFLE4(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
#define SHUFFLE4(a, b, i, j, k, l) __builtin_shuffle(a, b, (choice_four_t){i, j, k, l})
#endif

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
