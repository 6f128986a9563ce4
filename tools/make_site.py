"""Build the site of the docs into out/site: `make site`. It needs no server and no network to be read."""

from __future__ import annotations

import argparse
import base64
import json
import shutil
import subprocess
import sys
from pathlib import Path

from ldcs_ros import load_scene, shipped_scenes
from ldcs_ros.errors import DivergenceError
from ldcs_ros.plotting.annotations import annotations_of_scene
from ldcs_ros.plotting.style import save_figure
from ldcs_ros.plotting.surface import surface_figure
from ldcs_ros.scene import Scene

ROOT = Path(__file__).resolve().parents[1]
LINKED = ("ldcs_ros", "bags", "test", "tools", "msg_defs")
"""Folders of the checkout with files that the pages link to."""
TEMPLATES = ROOT / "tools/site"

GALLERY = """\
# Gallery

Each shipped scene as its shipped commands leave it: at rest, or after one second where nothing rests.
`ldcs simulate NAME` runs it, `ldcs scenes --show NAME` prints it.
"""

PYTHON = """\
# Python classes

What `import ldcs_ros` and its public rooms offer. Arrays are SI, in the frame `ldcs_base`.
"""
# The modules of the public classes, in the order in which a reader meets them.
MODULES = (
    "ldcs_ros.scene.scene",
    "ldcs_ros.scene.load",
    "ldcs_ros.simulation.simulation",
    "ldcs_ros.simulation.inputs",
    "ldcs_ros.physics.state",
    "ldcs_ros.simulation.stability",
    "ldcs_ros.simulation.sensitivity",
    "ldcs_ros.simulation.linear_model",
    "ldcs_ros.reach.reach",
    "ldcs_ros.bags.reader",
    "ldcs_ros.bags.writer",
    "ldcs_ros.sensors.tracker",
    "ldcs_ros.physics.effects.base",
    "ldcs_ros.integrators.base",
)


def main() -> int:
    """Stage the pages beside the generated ones and run Sphinx; a warning is an error. Return its exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "out/site")
    parser.add_argument("--staging", type=Path, default=ROOT / "build/site")
    arguments = parser.parse_args()
    stage(arguments.staging)
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "--builder",
        "html",
        "--fail-on-warning",
        "--keep-going",
        "--quiet",
    ]
    command += ["--conf-dir", str(TEMPLATES), str(arguments.staging / "docs"), str(arguments.output)]
    status = subprocess.run(command, check=False).returncode
    if status == 0:
        print(f"the site is in {arguments.output}; open {arguments.output / 'index.html'}")
    return status


def stage(folder: Path) -> None:
    """Copy the pages and what they link to into a fresh `folder`, and write the generated pages beside them."""
    shutil.rmtree(folder, ignore_errors=True)
    docs = folder / "docs"
    shutil.copytree(ROOT / "docs", docs)
    shutil.copy(TEMPLATES / "index.md", docs)
    for name in LINKED:
        (folder / name).symlink_to(ROOT / name)
    # The page of the reference bags is the only one outside of docs/.
    shutil.copy(ROOT / "bags/README.md", docs / "reference_bags.md")
    replay = docs / "replay.md"
    replay.write_text(
        replay.read_text(encoding="utf-8").replace("../bags/README.md", "reference_bags.md"), encoding="utf-8"
    )
    for path in sorted((ROOT / "docs/notebooks").glob("*.ipynb")):
        (docs / "notebooks" / f"{path.stem}.md").write_text(
            notebook_page(path, docs / "images"), encoding="utf-8"
        )
    (docs / "gallery.md").write_text(gallery(docs / "images"), encoding="utf-8")
    (docs / "python.md").write_text(python_page(), encoding="utf-8")


def gallery(pictures: Path) -> str:
    """Draw every shipped scene into `pictures` and return the page that shows them."""
    page = GALLERY
    for name in shipped_scenes():
        scene = load_scene(name)
        draw(scene, pictures / f"scene_{name}.png")
        page += f"\n## {name}\n\n{scene.title}.\n\n![The scene {name}](images/scene_{name}.png)\n"
    return page


def draw(scene: Scene, target: Path) -> None:
    """Draw a scene at rest, or after a second where it has no rest state."""
    simulation = scene.build()
    try:
        simulation.settle()
    except DivergenceError:
        simulation.reset()
        simulation.advance_to(1.0)
    state = simulation.state
    sheet = state.position.reshape(2, *scene.lattice.nodes, 3)
    save_figure(surface_figure([sheet], [state.time], annotations_of_scene(scene, title=scene.title)), target)


def notebook_page(path: Path, pictures: Path) -> str:
    """Return a notebook as a page: text, code and what the code printed; its pictures go into `pictures`."""
    page = []
    for number, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"]):
        source = "".join(cell["source"])
        page.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if "image/png" in data:
                picture = pictures / f"notebook_{path.stem}_{number}.png"
                picture.write_bytes(base64.b64decode("".join(data["image/png"])))
                page.append(f"![Output of the cell above](../images/{picture.name})")
            else:
                text = "".join(output.get("text") or data.get("text/plain", ""))
                page.append(f"```text\n{text.rstrip()}\n```")
    return (
        "\n\n".join(page) + f"\n\n[The notebook](../../docs/notebooks/{path.name}) itself runs in Jupyter.\n"
    )


def python_page() -> str:
    """Return the page of the public classes, from their docstrings."""
    page = PYTHON
    for module in MODULES:
        page += f"\n## {module}\n\n```{{eval-rst}}\n.. automodule:: {module}\n   :members:\n```\n"
    return page


if __name__ == "__main__":
    raise SystemExit(main())
