/* Kernels for what NumPy does at several times the price: module uavrt.core._native.

   Each does what a function of the package does in NumPy, which stays and is used where this
   module is not there; `uavrt.core.runtime.native` says which. Buffers only, no NumPy, CPython's stable
   interface: one build serves every Python from 3.11 on. Sizes are checked against the buffers
   before anything is read or written; the work is done in loops that are compiled for several
   processors (loops.h). */
#include "anchors.h"
#include "band.h"
#include "bank.h"
#include "beeps.h"
#include "codes.h"
#include "fir.h"
#include "levels.h"
#include "terrain.h"
#include "trains.h"

/* choose(most): take the loops for this processor, or older ones: "plain", "avx2" or "avx512",
   the newest that may be taken. Returns the name of those in use. */
static PyObject *choose(PyObject *self, PyObject *most)
{
    (void)self;
    PyObject *name = PyUnicode_AsASCIIString(most);
    if (name == NULL)
        return NULL;
    const char *taken = choose_loops(PyBytes_AsString(name));
    Py_DECREF(name);
    return PyUnicode_FromString(taken);
}

static PyMethodDef methods[] = {
    {"bank", (PyCFunction)(void (*)(void))bank, METH_FASTCALL,
     "Outputs of a filter bank: uavrt.dsp.channelizer."},
    {"choose", choose, METH_O, "Take loops for some processor; the name of those in use."},
    {"decimate", (PyCFunction)(void (*)(void))decimate, METH_FASTCALL,
     "Filter and keep every D-th sample: uavrt.dsp.decimator."},
    {"edges", (PyCFunction)(void (*)(void))edges, METH_FASTCALL,
     "Profiles of the ground to all cells: uavrt.localization.terrain.viewshed."},
    {"folds", (PyCFunction)(void (*)(void))folds, METH_FASTCALL,
     "Best sums of several bursts: uavrt.detection.coded.sums."},
    {"follow", (PyCFunction)(void (*)(void))follow, METH_FASTCALL,
     "Levels that change: uavrt.detection.search.levelling."},
    {"largest", (PyCFunction)(void (*)(void))largest, METH_FASTCALL,
     "Largest part of any sample: uavrt.detection.signal.sample_buffer."},
    {"level", (PyCFunction)(void (*)(void))level, METH_FASTCALL,
     "Divide new columns by their level: uavrt.detection.search.levelling."},
    {"narrow", (PyCFunction)(void (*)(void))narrow, METH_FASTCALL,
     "A tag's narrow band: uavrt.detection.search.grid."},
    {"powers", (PyCFunction)(void (*)(void))powers, METH_FASTCALL,
     "Power of the cells of a tag's spectrogram: uavrt.detection.search.grid."},
    {"note", (PyCFunction)(void (*)(void))note, METH_FASTCALL,
     "Keep new columns and find anchors among them: uavrt.detection.search.anchors."},
    {"rate", (PyCFunction)(void (*)(void))rate, METH_FASTCALL,
     "Best sums of anchors: uavrt.detection.search.anchors."},
    {"seeds", (PyCFunction)(void (*)(void))seeds, METH_FASTCALL,
     "Sums of the cells of bursts: uavrt.detection.coded.sums."},
    {"spectrogram", (PyCFunction)(void (*)(void))spectrogram, METH_FASTCALL,
     "Power of a whole band in windows: uavrt.detection.beeps.beep_points."},
    {"train_peaks", (PyCFunction)(void (*)(void))train_peaks, METH_FASTCALL,
     "Highest sums of trains for each place: uavrt.localization.whole_flight.energies.folding."},
    {"train_sums", (PyCFunction)(void (*)(void))train_sums, METH_FASTCALL,
     "Sums of trains at all intervals: uavrt.localization.whole_flight.energies.folding."},
    {NULL, NULL, 0, NULL},
};

/* The number that uavrt/core/runtime/native.py asks for: raised when arguments of a kernel change. */
#define INTERFACE 7

static int fill(PyObject *module)
{
    choose_loops("avx512");
    return PyModule_AddIntConstant(module, "INTERFACE", INTERFACE) < 0 ||
                   PyModule_AddStringConstant(module, "BUILT", BUILT_FOR) < 0
               ? -1
               : 0;
}

static PyModuleDef_Slot slots[] = {{Py_mod_exec, (void *)fill}, {0, NULL}};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "_native",
    .m_doc = "Compiled kernels of uavrt; native/kernels.c.",
    .m_size = 0,
    .m_methods = methods,
    .m_slots = slots,
};

PyMODINIT_FUNC PyInit__native(void)
{
    return PyModuleDef_Init(&definition);
}
