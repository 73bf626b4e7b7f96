"""Make every picture of the documents: `make pictures`. The pages of docs/how_to are run for
theirs, so that a picture shows what the commands beside it give.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from tests.documents.blocks import HOW_TO, ROOT, script_of
from tests.documents.kinds import EXIT_CODES, WITH_AN_ARM
from tests.documents.shell import run_script
from tests.reporting.browsing import browse

IMAGES = ROOT / "docs" / "images"
COLOURS = 128
"""Of a picture, so that it stays small."""
FIRST_SCREEN = (1100, 1050)
"""Of a run, down to its main figure [px]."""
KEEP = """<script>
for (const part of document.querySelectorAll("main > *")) {
  if (!KEPT.includes(part.id)) part.remove();
}
HEADER || document.querySelector("header").remove();
for (const part of document.querySelectorAll("main section > *")) {
  if (FIGURES && !part.matches("h2") && !part.querySelector(".figure") && !part.matches(".figure"))
    part.remove();
}
document.querySelector("footer").remove();
</script>
"""


@dataclass(frozen=True)
class Picture:
    """A picture of a page that commands have made.

    Attributes:
        file: What is drawn, by a pattern below the folder that the commands ran in.
        parts: Keys of the sections that are kept.
        page: Page of docs/how_to whose commands run first.
        script: Or commands of its own.
        header: Whether the title of the page stays.
        figures: Whether of the sections only headings and figures stay.
        size: Of the window, and at most of the picture [px].
    """

    file: str
    parts: tuple[str, ...] = ("answer",)
    page: str = ""
    script: str = ""
    header: bool = True
    figures: bool = False
    size: tuple[int, int] = (1100, 800)


PICTURES = {
    "report": Picture(
        "logs/*_elbow_flexion/report.html",
        ("joints",),
        script="testbench run elbow_flexion\n",
        header=False,
        figures=True,
        size=(1100, 1100),
    ),
    "comparison": Picture("firmware.html", page="compare_two_firmwares"),
    "how_to_knee": Picture("logs/squat/report.html", page="two_dots_and_a_knee"),
    "how_to_walk": Picture(
        "logs/walk/report.html",
        ("gait",),
        "walk_with_a_foot_sensor",
        figures=True,
        size=(1100, 900),
    ),
    "how_to_phone": Picture("logs/phone/report.html", page="phone_against_cameras"),
    "how_to_noise": Picture(
        "logs/*_static_noise/report.html",
        ("recording",),
        "noise_of_a_sensor",
        figures=True,
        size=(1100, 645),
    ),
    "how_to_calibrate": Picture("calibrations/*.html", page="calibrate_a_sensor"),
    "how_to_protocol": Picture(
        "logs/*_bend/report.html", page="write_a_protocol", size=FIRST_SCREEN
    ),
    "how_to_ur": Picture("logs/*_quick/report.html", page="rehearse_a_ur", size=FIRST_SCREEN),
    "how_to_tune": Picture("logs/3/*_quick/report.html", page="tune_a_filter", size=FIRST_SCREEN),
    "how_to_filter": Picture("logs/*_quick/report.html", page="add_a_filter", size=FIRST_SCREEN),
}
"""By name; the viewer's is made by `viewer`."""
VIEWER = """\
testbench run elbow_flexion --no-report
testbench view logs/*_elbow_flexion --screenshot viewer.png
"""


def draw(picture: Picture, folder: Path, out: Path) -> None:
    """Draw a page that was made in a folder into a file.

    Args:
        picture: What of it.
        folder: Where the commands ran.
        out: The picture.
    """
    (page,) = folder.glob(picture.file)
    text = page.read_text(encoding="utf-8")
    script = KEEP.replace("KEPT", str(list(picture.parts)))
    script = script.replace("HEADER", str(picture.header).lower())
    script = script.replace("FIGURES", str(picture.figures).lower())
    copy = page.with_name(f"cut_{page.name}")
    copy.write_text(text.replace("</footer>", f"</footer>{script}", 1), encoding="utf-8")
    width, height = picture.size
    shot = folder / "shot.png"
    browse(copy, folder / "profile", f"--window-size={width},{height}", f"--screenshot={shot}")
    cut(Image.open(shot).convert("RGB")).quantize(COLOURS).save(out, optimize=True)
    copy.unlink()


def cut(image: Image.Image) -> Image.Image:
    """A picture without the empty paper below what is on it."""
    pixels = np.asarray(image)
    drawn = np.flatnonzero((pixels != pixels[-1, 0]).any(axis=(1, 2)))
    return image.crop((0, 0, image.width, min(image.height, int(drawn[-1]) + 24)))


def make(name: str) -> None:
    """Make one picture; says when its commands fail."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        picture = PICTURES.get(name)
        arm = picture is not None and picture.page in WITH_AN_ARM
        if picture is None:
            script = VIEWER
        else:
            script = picture.script or script_of(HOW_TO / f"{picture.page}.md")
        code, out, err = run_script(script, folder, own_processes=arm)
        wanted = 0 if picture is None else EXIT_CODES.get(picture.page, 0)
        if code != wanted:
            sys.exit(f"{name}: exit code {code}\n{out}{err}")
        if picture is None:
            shot = Image.open(folder / "viewer.png").convert("RGB")
            shot.quantize(COLOURS).save(IMAGES / "viewer.png", optimize=True)
        else:
            draw(picture, folder, IMAGES / f"{name}.png")
    print(f"docs/images/{name}.png", flush=True)


if __name__ == "__main__":
    for wanted in sys.argv[1:] or [*PICTURES, "viewer"]:
        make(wanted)
