"""What a cell learns from the whole photo: self-attention over the coarsest cells."""

from __future__ import annotations

import torch
from torch import Tensor, nn

HEADS = 4


class ContextBlock(nn.Module):
    """Self-attention and a two-layer perceptron, each on normalised tokens with a shortcut (Vaswani et al. 2017)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.before_attention = nn.LayerNorm(width)
        self.query_key_value = nn.Linear(width, 3 * width)
        self.joined = nn.Linear(width, width)
        self.before_perceptron = nn.LayerNorm(width)
        self.perceptron = nn.Sequential(nn.Linear(width, 2 * width), nn.ReLU(), nn.Linear(2 * width, width))

    def forward(self, tokens: Tensor) -> Tensor:
        """(B, N, width) -> the same shape."""
        batch, count, width = tokens.shape
        split = self.query_key_value(self.before_attention(tokens)).reshape(batch, count, 3, HEADS, width // HEADS)
        query, key, value = split.permute(2, 0, 3, 1, 4).unbind(0)
        weights = torch.softmax(query @ key.transpose(-1, -2) * (width // HEADS) ** -0.5, dim=-1)
        seen = (weights @ value).transpose(1, 2).reshape(batch, count, width)
        tokens = tokens + self.joined(seen)
        return tokens + self.perceptron(self.before_perceptron(tokens))
