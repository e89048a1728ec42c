"""NormalEquations: those of windows with free starts, which are eliminated one by one (Schur complement)."""

from __future__ import annotations

import numpy as np

from dojo_opt.identification.windows import WindowErrors
from solvers.types import Floats

__all__ = ["NormalEquations"]


class NormalEquations:
    """Normal equations of errors r + P d + S_k s_k by the parameters over their units, d, and by the starts of windows.

    PP, Pr  P'P (n, n), P'r (n,)
    SS, SPr  S_k'S_k (windows, ndx, ndx), S_k'(P, r) (windows, ndx, n + 1)
    """

    def __init__(self, found: list[WindowErrors], weights: list[Floats], unit: Floats) -> None:
        n = len(unit)
        self.PP, self.Pr = np.zeros((n, n)), np.zeros(n)
        SS, SPr = [], []
        for w, weight in zip(found, weights, strict=True):
            rows = np.repeat(np.sqrt(weight), w.errors.shape[1])
            r = rows * w.errors.ravel()
            S = rows[:, None] * w.by_start.reshape(len(r), -1)
            P = rows[:, None] * w.by_theta.reshape(len(r), -1) * unit
            self.PP += P.T @ P
            self.Pr += P.T @ r
            SS.append(S.T @ S)
            SPr.append(S.T @ np.column_stack([P, r]))
        self.SS, self.SPr = np.array(SS), np.array(SPr)

    def reduced(self, damping: float) -> tuple[Floats, Floats, Floats]:
        """(H, g, back) without the starts: H d = -g, s_k = -back_k (d, 1)."""
        diagonal = np.einsum("kii->ki", self.SS)
        least = 1e-12 * np.maximum(diagonal.sum(axis=1, keepdims=True), 1e-12)
        damped = self.SS + (damping * diagonal + least)[:, :, None] * np.eye(self.SS.shape[1])
        back = np.linalg.solve(damped, self.SPr)
        taken = np.einsum("kin,kim->nm", self.SPr[:, :, :-1], back, optimize=True)
        return self.PP - taken[:, :-1], self.Pr - taken[:, -1], back

    def change(self, d: Floats, moves: Floats) -> float:
        """Change of the sum of squares, |r + P d + S s|^2 - |r|^2, by d (n,) and the moves (windows, ndx) of starts."""
        by_start = 2.0 * (self.SPr[:, :, -1] + self.SPr[:, :, :-1] @ d) + np.einsum("kij,kj->ki", self.SS, moves)
        return float(d @ (self.PP @ d + 2.0 * self.Pr) + np.sum(moves * by_start))
