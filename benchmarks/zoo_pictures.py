"""A contact sheet of the robots of two packages: each stands in its neutral state, drawn by the page of `save_html`.

    pip install "dojo-opt[meshes,browser]" example-robot-data pybullet
    python benchmarks/zoo_pictures.py --sheet zoo.png
    python benchmarks/zoo_pictures.py --match go --sheet go.png

Files with the same bodies and masses are one robot. A headless Chromium draws every page, so the pictures show the
page as a user sees it. The report lists the robots with the size of their page, and explains each missing picture.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import warnings
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from command import deliver, number, parser, progress
from urdf_zoo import load, package_files

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Report, Table

COLUMNS, WIDTH, HEIGHT = 8, 320, 240  # of the sheet, and of a picture in pixels
WAIT = 1500  # [ms] until a page is drawn
LIMIT = 5e6  # bytes of a page
ARGUMENTS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]


def distinct(paths: list[Path]) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """By file, the mechanisms that differ; and (file, reason) of those that are refused."""
    found: dict[Any, tuple[str, Any]] = {}
    refused = []
    for path in paths:
        name = "/".join(path.parts[-2:])
        mech, _, reason = load(path)
        if mech is None:
            refused.append((name, " ".join(reason.split())[:120]))
            continue
        key = tuple((b.name, round(b.mass, 6)) for b in mech.bodies)
        found.setdefault(key, (name, mech))
    return dict(found.values()), refused


def pictures(robots: dict[str, Any]) -> dict[str, tuple[Any, int]]:
    """By file, the picture (HEIGHT, WIDTH, 3), and the size of its page in bytes."""
    from matplotlib.image import imread
    from playwright.sync_api import sync_playwright

    out = {}
    path = next((p for p in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if p), None)
    with sync_playwright() as session, tempfile.TemporaryDirectory() as folder:
        browser = session.chromium.launch(executable_path=path, args=ARGUMENTS)
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        for name, mech in progress()([(name, (name, mech)) for name, mech in robots.items()], "pictures"):
            file = dojo.viewer.save_html(mech, Path(folder) / "robot.html")
            page.goto(file.as_uri())
            page.add_style_tag(content="#bar {display: none !important}")
            page.wait_for_timeout(WAIT)
            image = imread(BytesIO(page.screenshot()))[..., :3]
            out[str(name)] = (image, file.stat().st_size)
        browser.close()
    return out


def sheet(found: dict[str, tuple[Any, int]], path: Path) -> None:
    """Write the pictures in rows, each with the name of its file."""
    from matplotlib.figure import Figure

    rows = -(-len(found) // COLUMNS)
    figure = Figure(figsize=(COLUMNS * 2.0, rows * 1.65), dpi=100)
    for k, (name, (image, _)) in enumerate(found.items()):
        ax = figure.add_axes((k % COLUMNS / COLUMNS, 1.0 - (k // COLUMNS + 1) / rows, 1.0 / COLUMNS, 0.92 / rows))
        ax.imshow(image)
        ax.set_title(name.rsplit("/", 1)[-1].removesuffix(".urdf"), fontsize=6, pad=1)
        ax.axis("off")
    figure.savefig(path)


def measure(args: argparse.Namespace) -> Report:
    """The robots, and how many have a picture that is not empty."""
    paths = [p for p in args.files or package_files() if args.match in str(p) and "random_urdfs" not in p.parts]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robots, refused = distinct(paths[: 3 if args.quick else None])
        found = pictures(robots)
    if args.sheet and found:
        sheet(found, args.sheet)
    # the floor and the sky have hardly any colour, and no sharp edges but the lines of the floor
    drawn = [name for name, (image, _) in found.items() if _covered(image) > 0.01]
    report = Report("Pictures of robots", "")
    report.rows = [
        number("robots", len(robots)),
        number("with an empty picture", len(found) - len(drawn), 0),
        number("pages above 5 MB", sum(size > LIMIT for _, size in found.values()), 0),
        number("refused", len(refused)),
    ]
    lines: list[list[Cell]] = [[name, size / 1e6, name in drawn, ""] for name, (_, size) in found.items()]
    lines += [[name, None, False, reason] for name, reason in refused]
    report.tables = [Table("Files", ("file", "page", "drawn", "refused"), lines, "page in MB")]
    return report


def _covered(image: Any) -> float:
    """Share of the middle half of a picture that is neither sky nor floor, both of which are light."""
    middle = image[HEIGHT // 4 : 3 * HEIGHT // 4, WIDTH // 4 : 3 * WIDTH // 4]
    return float(np.mean(middle.min(axis=2) < 0.68))


def main(argv: list[str] | None = None) -> int:
    """Print or write the report and the sheet; exit status 1 if a robot has no picture."""
    arguments = parser(__doc__)
    arguments.add_argument("files", nargs="*", type=Path, help="URDF files; default: all files of the two packages")
    arguments.add_argument("--match", default="", help="only files with this in their path")
    arguments.add_argument("--sheet", type=Path, metavar="FILE", help="write the contact sheet, a PNG")
    return deliver("zoo_pictures", measure, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
