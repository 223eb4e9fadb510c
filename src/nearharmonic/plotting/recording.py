"""Drawing calls of a figure: laid out once, and repeated for the file of each format."""

from __future__ import annotations

from typing import Any

from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D, Transform, TransformedBbox, TransformedPath


def _keeping(name: str) -> Any:
    def keep(self: Recorder, *arguments: Any, **options: Any) -> None:
        gc: Any = self.new_gc()  # artists change theirs, and transforms, after the call
        if name.startswith("draw"):
            gc.copy_properties(arguments[0])
            clip, (path, affine) = gc.get_clip_rectangle(), gc.get_clip_path()
            gc.set_clip_rectangle(clip and clip.frozen())
            gc.set_clip_path(path and TransformedPath(path, affine.frozen()))
            arguments = tuple(one.frozen() if isinstance(one, Transform) else one for one in arguments[1:])
        self.calls.append((name, gc, arguments, options))

    return keep


class Recorder(RendererBase):
    """Renderer that keeps calls: name, graphics context, arguments, options. Images raise a NotImplementedError."""

    def __init__(self, width: float, height: float) -> None:
        super().__init__()
        self.calls: list[tuple[str, Any, Any, Any]] = []
        self._size = width, height

    def get_canvas_width_height(self) -> tuple[float, float]:
        return self._size

    def flipy(self) -> bool:
        return False

    def start_rasterizing(self) -> None:
        raise NotImplementedError

    open_group, close_group = _keeping("open_group"), _keeping("close_group")
    draw_path, draw_markers, draw_text = _keeping("draw_path"), _keeping("draw_markers"), _keeping("draw_text")
    draw_path_collection, draw_quad_mesh = _keeping("draw_path_collection"), _keeping("draw_quad_mesh")


class Recording(Figure):
    """A figure that draws as ``figure`` does at the time of the call, without layout. It has no artists."""

    def __init__(self, figure: Figure) -> None:
        width, height = figure.get_size_inches().tolist()
        super().__init__(figsize=(width, height))
        recorder, own = Recorder(72 * width, 72 * height), figure.dpi
        figure.set_dpi(72)  # points
        try:
            figure.draw(recorder)
        finally:
            figure.set_dpi(own)
        self._calls = recorder.calls

    def draw(self, renderer: Any) -> None:
        """Repeat the calls at the resolution of this figure."""
        scale, height = Affine2D().scale(self.dpi / 72), renderer.get_canvas_width_height()[1]
        for name, kept, arguments, options in self._calls:
            scaled = [one + scale if isinstance(one, Transform) else one for one in arguments]
            if name.startswith("draw"):
                gc = renderer.new_gc()
                gc.copy_properties(kept)
                clip, (path, affine) = kept.get_clip_rectangle(), kept.get_clip_path()
                gc.set_clip_rectangle(clip and TransformedBbox(clip, scale))
                gc.set_clip_path(path and TransformedPath(path, affine + scale))
                if name == "draw_text":
                    x, y = scale.transform(arguments[:2])
                    scaled[:2] = x, height - y if renderer.flipy() else y
                scaled.insert(0, gc)
            getattr(renderer, name)(*scaled, **options)
