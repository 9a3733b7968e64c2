"""What sphinx-gallery needs to know of Elevon's examples."""

import shutil
from pathlib import Path

from sphinx_gallery.scrapers import figure_rst

ENDINGS = (".png", ".svg")


def pictures(block, block_vars, gallery_conf):  # noqa: ARG001 - sphinx-gallery's signature
    """Take the pictures that an example wrote into its folder."""
    folder = Path(block_vars["src_file"]).parent
    taken = []
    for picture in sorted(p for p in folder.iterdir() if p.suffix in ENDINGS):
        target = Path(next(block_vars["image_path_iterator"])).with_suffix(picture.suffix)
        shutil.move(picture, target)
        taken.append(str(target))
    title = Path(block_vars["src_file"]).stem.replace("_", " ")
    return figure_rst(taken, gallery_conf["src_dir"], f"Picture of the example {title}")
