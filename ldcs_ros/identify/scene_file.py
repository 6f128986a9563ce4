"""The fitted scene as a file whose header reports the parameters, the bags and the quality of the fit."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ldcs_ros.errors import RecordingError
from ldcs_ros.identify.diagnostics import Misfit, ParameterEstimate, Score
from ldcs_ros.identify.experiments import Experiment
from ldcs_ros.identify.identify import Identification
from ldcs_ros.schema.reader import write_yaml

WIDTH = 116


def scene_text(found: Identification, experiments: Sequence[Experiment], *, origin: str) -> str:
    """Return the fitted scene as YAML with its header.

    Args:
        found: The identification.
        experiments: The bags that were fitted.
        origin: Name of the scene at the start.
    """
    content = dict(found.content)
    content["title"] = f"{content.get('title', origin)} (identified)"
    lines = [f"Fitted by `ldcs identify`, starting from the scene {origin}."]
    lines += ["", "Fitted numbers with 95 % intervals:"]
    lines += [f"  {estimate_words(item)}" for item in found.estimates]
    lines += ["", "Fitted to the tracker poses of these bags (standard deviation of the noise in brackets):"]
    for experiment, item in zip(experiments, found.fitted, strict=True):
        lines.append(f"  {score_words(item)} [{1e3 * experiment.noise:.3g} mm, {experiment.noise_origin}]")
    if found.held_out:
        lines += ["", "Predicted, not fitted:"]
        lines += [f"  {score_words(item)}" for item in found.held_out]
    lines += ["", f"{'MISFIT: ' if found.misfit.found else 'Structure: '}{found.misfit.words}."]
    if len(found.minima) > 1:
        lines.append(f"{len(found.minima)} different minima were found; this is the best.")
    header = "\n".join(f"# {line}".rstrip() for part in lines for line in _wrapped(part))
    body = write_yaml(content, flow=None, width=WIDTH)
    return f"{header}\n{body}"


def write_scene(path: Path, text: str) -> None:
    """Write a scene file; one that exists is not overwritten.

    Raises:
        RecordingError: It exists, or cannot be written.
    """
    try:
        with open(path, "x", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
    except FileExistsError as error:
        raise RecordingError(f"{path} exists; name another file with -o, nothing was written") from error
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror}") from error


def estimate_words(item: ParameterEstimate) -> str:
    """Return a fitted number in words: path, value, interval and its flaws."""
    remark = (
        ", at its bound" if item.at_bound else ", hardly determined by the data" if item.undetermined else ""
    )
    p = item.parameter
    searched = f"searched in {p.low:.4g} ... {p.high:.4g} from {p.start:.6g}"
    return f"{p.path} = {item.value:.6g}  ({item.low:.6g} ... {item.high:.6g}{remark}; {searched})"


def score_words(item: Score) -> str:
    """Return a bag's score in words."""
    return (
        f"{item.name}: {item.count} coordinates, reduced chi-square {item.reduced_chi_square:.3f}, "
        f"{100.0 * item.within_three:.2f} % within 3 sigma"
    )


def as_dict(found: Identification) -> dict[str, Any]:
    """Return an identification as plain values."""
    return {
        "parameters": [
            {
                "path": item.parameter.path,
                "value": item.value,
                "low": item.low,
                "high": item.high,
                "start": item.parameter.start,
                "bounds": [item.parameter.low, item.parameter.high],
                "at_bound": item.at_bound,
                "undetermined": item.undetermined,
            }
            for item in found.estimates
        ],
        "correlation": found.correlation,
        "misfit": _plain(found.misfit),
        "whole": _plain(found.whole),
        "fitted": [_plain(item) for item in found.fitted],
        "held_out": [_plain(item) for item in found.held_out],
        "minima": len(found.minima),
        "evaluations": found.evaluations,
        "slopes": found.slopes,
    }


def _plain(item: Score | Misfit) -> dict[str, Any]:
    # The JSON keeps its published key.
    return {"lasting" if name == "ljung_box_z" else name: value for name, value in vars(item).items()}


def _wrapped(line: str) -> list[str]:
    return textwrap.wrap(line, WIDTH, subsequent_indent="    ", drop_whitespace=False) or [""]
