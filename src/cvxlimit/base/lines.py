"""Texts of files and of users as one line that a terminal can show."""


def one_line(text: str) -> str:
    """The text in one line: words longer than any of ours lose their middle, and a very long text
    its end; what would break the line or act on a terminal is written as an escape."""
    words = (
        word if len(word) <= 250 else f"{word[:120]} ... {word[-120:]}" for word in text.split(" ")
    )
    text = " ".join(words)
    if len(text) > 1000:
        text = f"{text[:1000]} ..."
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
