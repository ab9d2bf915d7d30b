# SPDX-License-Identifier: Apache-2.0
"""
The gate: whether two revisions of the package give the same bytes, and which is faster.

Both revisions are compiled and run on the same machine. Stored golden values are not possible:
the kernels allow the compiler to fuse and to reorder floating-point operations, so the last bits
depend on the processor and on the versions of numba and LLVM.

The gate uses the public names of `color_stereo_ros.core` only, in `worker`, which runs once for
each tree. It makes all images itself (`scenes`), so that both trees measure the same ones.

"""
