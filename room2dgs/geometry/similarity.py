"""Structural similarity of images."""

from __future__ import annotations

import kornia.metrics
from torch import Tensor
from torch.nn.functional import pad

WINDOW = 11  # pixels of the Gaussian window's side; sigma is 1.5


def ssim(first: Tensor, second: Tensor, border: str) -> Tensor:
    """SSIM (Wang et al. 2004) at every pixel and channel, C1 = 0.01^2, C2 = 0.03^2; differentiable.

    Args:
        first, second: (H, W, C), colours in 0..1, any floating dtype.
        border: "zeros": both images are black outside, as 3DGS and 2DGS train; "inside": only pixels whose whole
            window lies in the image count, as metrics have it.

    Returns:
        (H, W, C), or (H - 10, W - 10, C) with "inside"; 1 where the images agree.
    """
    a, b = (image.permute(2, 0, 1)[None] for image in (first, second))
    if border == "zeros":
        a, b = (pad(image, [WINDOW // 2] * 4) for image in (a, b))
    return kornia.metrics.ssim(a, b, WINDOW, eps=0.0, padding="valid")[0].permute(1, 2, 0)
