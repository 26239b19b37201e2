"""Pieces of the report's page: tables, figures, error maps."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
ERROR_SPAN = 1.0  # times the mean: differences of this much are shown in full colour


def difference_map(difference: FloatArray, mean: float) -> FloatArray:
    """(H, W, 3) in [0, 1]: white is no error, red too bright, blue too dark."""
    x = np.clip(difference / (ERROR_SPAN * mean), -1.0, 1.0)
    fade = 1.0 - np.abs(x)
    return np.stack([np.where(x < 0, fade, 1.0), fade, np.where(x > 0, fade, 1.0)], axis=-1)


def png(image: FloatArray) -> bytes:
    """An image in [0, 1], (H, W) or (H, W, 3)."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray((np.clip(image, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)).save(buffer, format="PNG")
    return buffer.getvalue()


def image_tag(data: bytes, kind: str, alt: str) -> str:
    """A PNG as an element of a class, with its bytes in it."""
    text = base64.b64encode(data).decode("ascii")
    return f'<img class="{kind}" alt="{html.escape(alt)}" src="data:image/png;base64,{text}">'


def figure(data: bytes, caption: str) -> str:
    """A PNG with its caption."""
    return f"<figure>{image_tag(data, '', caption)}<figcaption>{html.escape(caption)}</figcaption></figure>"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Cells are HTML already; the head is text."""
    top = "".join(f"<th>{html.escape(h)}</th>" for h in head)
    cells = "".join("<tr>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table><tr>{top}</tr>{cells}</table></div>'


def show(value: float | None, form: str) -> str:
    """A number, or nothing."""
    return "" if value is None else format(value, form)
