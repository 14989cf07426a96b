"""Write the pages that are built with the site into docs/built, which is not committed: python docs/build_pages.py.

docs/conf.py does so before sphinx reads the documents.
"""

from pathlib import Path

import generate_accuracy
import generate_api
import generate_maps
import generate_rates
import make_images

BUILT = Path(__file__).with_name("built")


def page_texts() -> dict[str, str]:
    """Markdown of each page, by its path in docs/built."""
    return {
        "api.md": generate_api.page_text(),
        "accuracy.md": generate_accuracy.page_text(),
        "images.md": make_images.page_text(),
        "rates.md": generate_rates.page_text(),
        "maps/index.md": generate_maps.index_text(),
        **{f"maps/{kind}.md": generate_maps.page_text(kind) for kind in generate_maps.PAGES},
    }


def write() -> None:
    """Write pages that changed, so that sphinx reads only those again."""
    for name, text in page_texts().items():
        path = BUILT / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")
    generate_rates.picture().savefig(BUILT / "rates.png", dpi=110)


if __name__ == "__main__":
    write()
