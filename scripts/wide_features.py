"""Print the features of this processor that numpy can do without (NPY_DISABLE_CPU_FEATURES)."""

try:
    from numpy._core import _multiarray_umath as core
except ImportError:  # numpy 1.26, Jazzy's
    from numpy.core import _multiarray_umath as core

print(*(name for name in core.__cpu_dispatch__ if core.__cpu_features__.get(name)))
