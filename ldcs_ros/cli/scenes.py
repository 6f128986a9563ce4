"""`ldcs scenes`: the shipped scenes with their titles."""

from __future__ import annotations

import argparse

from ldcs_ros.cli.output import print_json, print_pairs

DESCRIPTION = """\
List the shipped scenes. Each can be named wherever a scene is asked for; copy one to start your own."""
EXAMPLE = """\
ldcs scenes
  ldcs scenes --show paper > my_scene.yaml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "--show", metavar="SCENE", help="print the YAML text of one scene instead of the list"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the scenes; exit status 0."""
    from ldcs_ros import load_scene, shipped_scenes

    if arguments.show is not None:
        scene = load_scene(arguments.show)
        if arguments.json:
            print_json({"name": scene.name, "title": scene.title, "text": scene.text})
        else:
            print(scene.text, end="" if scene.text.endswith("\n") else "\n")
        return 0
    titles = {name: load_scene(name).title for name in shipped_scenes()}
    if arguments.json:
        print_json({"scenes": [{"name": name, "title": title} for name, title in titles.items()]})
    else:
        print_pairs(titles.items())
    return 0
