"""What a network's answer costs: which cell answers for which object, and how wrong it is."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

_CELLS_PER_OBJECT = 10
_NEAR = 0.75  # strides around an object's center within which a cell may answer for it
_SCORE_POWER, _IOU_POWER = 0.5, 6.0
_BOX_WEIGHT = 2.5
_SMALL = 1e-7


def detection_loss(
    boxes: Tensor,
    logits: Tensor,
    true_boxes: Tensor,
    true_classes: Tensor,
    points: Tensor,
    strides: Tensor,
) -> Tensor:
    """Return the loss of a batch.

    A cell's classes are to say how well it fits, by binary cross entropy; boxes are drawn to
    the truth by generalized IoU.

    Args:
        boxes: xmin, ymin, xmax, ymax of each cell [pixels], shape (B, N, 4).
        logits: of the classes, shape (B, N, C).
        true_boxes: shape (B, M, 4); zeros fill up images with fewer objects.
        true_classes: shape (B, M); -1 fills up.
        points: the cells' centers [pixels], shape (N, 2).
        strides: their sizes [pixels], shape (N, 1).
    """
    with torch.no_grad():
        owner, quality = _assign(boxes, logits, true_boxes, true_classes, points, strides)
    is_object = quality > 0
    targets = torch.zeros_like(logits)
    classes = true_classes.clamp(min=0).gather(1, owner)
    targets.scatter_(2, classes.unsqueeze(2), quality.unsqueeze(2))
    total = quality.sum().clamp(min=1.0)
    class_loss = functional.binary_cross_entropy_with_logits(logits, targets, reduction="sum")
    matched = true_boxes.gather(1, owner.unsqueeze(2).expand(-1, -1, 4))
    misfit = 1 - giou(boxes[is_object], matched[is_object])
    return (class_loss + _BOX_WEIGHT * (misfit * quality[is_object]).sum()) / total


def giou(a: Tensor, b: Tensor) -> Tensor:
    """Return the generalized IoU of boxes (..., 4), from -1 to 1.

    Source: Rezatofighi et al., "Generalized Intersection over Union", 2019.
    """
    iou, union = _iou(a, b)
    around = (torch.maximum(a[..., 2:], b[..., 2:]) - torch.minimum(a[..., :2], b[..., :2])).prod(
        -1
    )
    return iou - (around - union) / (around + _SMALL)


def _iou(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor]:
    shared = torch.minimum(a[..., 2:], b[..., 2:]) - torch.maximum(a[..., :2], b[..., :2])
    shared = shared.clamp(min=0).prod(-1)
    areas = ((box[..., 2:] - box[..., :2]).clamp(min=0).prod(-1) for box in (a, b))
    union = sum(areas) - shared
    return shared / (union + _SMALL), union


def _assign(
    boxes: Tensor,
    logits: Tensor,
    true_boxes: Tensor,
    true_classes: Tensor,
    points: Tensor,
    strides: Tensor,
) -> tuple[Tensor, Tensor]:
    """Return which object each cell answers for, shape (B, N), and how well (0 for none).

    Of the cells in an object, those that fit best by score and IoU answer for it; where several
    objects want a cell, the one with the largest IoU has it.

    Source: Feng et al., "TOOD: Task-aligned One-stage Object Detection", 2021.
    """
    is_true = (true_classes >= 0).unsqueeze(2)  # (B, M, 1)
    low, high = true_boxes[..., None, :2], true_boxes[..., None, 2:]
    inside = ((points > low) & (points < high)).all(-1)
    near = ((points - (low + high) / 2).abs() < _NEAR * strides).all(-1)
    iou, _ = _iou(true_boxes.unsqueeze(2), boxes.unsqueeze(1))  # (B, M, N)
    index = true_classes.clamp(min=0).unsqueeze(2).expand(-1, -1, logits.shape[1])
    scores = logits.sigmoid().transpose(1, 2).gather(1, index)
    fit = scores**_SCORE_POWER * iou**_IOU_POWER * ((inside | near) & is_true)

    best = fit.topk(_CELLS_PER_OBJECT, dim=2)
    chosen = torch.zeros_like(fit).scatter_(2, best.indices, (best.values > 0).to(fit.dtype))
    owner = (iou * chosen).argmax(1)  # (B, N)
    is_owner = functional.one_hot(owner, fit.shape[1]).transpose(1, 2) * chosen
    fit = fit * is_owner
    # The best cell of an object is to have its IoU for a score.
    best_iou = (iou * is_owner).amax(2, keepdim=True)
    quality = fit / (fit.amax(2, keepdim=True) + 1e-12) * best_iou
    return owner, quality.amax(1)
