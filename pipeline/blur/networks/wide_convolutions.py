"""Convolutions of the paper's network by AVX-512 where the processor has it: about half the time, the same bytes.

Pins keep oneDNN to AVX2 (`pipeline.processor`), because another order of additions changes the last digits. Its
convolution of channels-last tensors (``brg_conv_fwd``) holds output channels in the lanes of a register and adds over
the kernel and the input channels one by one, so a wider register holds more sums and changes none. That is how the
paper's network (`pipeline.blur.networks.cnn_net`) is computed. The detectors' and the noise networks' convolutions
(``jit``) add in blocks of as many input channels as a register has lanes: they differ, and keep the pin.
"""

from __future__ import annotations

import os
import sys

from pipeline import processor

VARIABLE, ISA = "ONEDNN_MAX_CPU_ISA", "AVX512_CORE"


def allow() -> bool:
    """Allow them in this process, if it is one stage that computes no other network, as DVC runs it (``--params``).

    To be called before the first convolution: oneDNN reads the variable once. A sweep's process, which may run other
    estimators afterwards, and one that is not pinned are left as they are.

    Returns:
        whether they are allowed.
    """
    if processor.status() != processor.PINNED or "--params" not in sys.argv:
        return False
    os.environ[VARIABLE] = ISA
    return True
