"""Digits three lines high, to be read from the other side of the bench."""

GLYPHS = {
    "0": ("█▀█", "█ █", "▀▀▀"),
    "1": ("▀█ ", " █ ", "▀▀▀"),
    "2": ("▀▀█", "█▀▀", "▀▀▀"),
    "3": ("▀▀█", " ▀█", "▀▀▀"),
    "4": ("█ █", "▀▀█", "  ▀"),
    "5": ("█▀▀", "▀▀█", "▀▀▀"),
    "6": ("█▀▀", "█▀█", "▀▀▀"),
    "7": ("▀▀█", "  █", "  ▀"),
    "8": ("█▀█", "█▀█", "▀▀▀"),
    "9": ("█▀█", "▀▀█", "▀▀▀"),
    "-": ("  ", "▀▀", "  "),
    ".": (" ", " ", "▀"),
}


def big(number: str) -> list[str]:
    """Return three lines that spell a number of digits, a minus and a point."""
    glyphs = [GLYPHS[character] for character in number]
    return [" ".join(glyph[line] for glyph in glyphs) for line in range(3)]
