"""Words that pages and docstrings do without, and words in their place."""

INSTEAD = {
    r"seconds of the wall|wall seconds|s of wall\b": "elapsed time (there are walls here)",
    r"wall[- ]clock": "elapsed time",
    r"seconds of the processor|s of processor": "CPU seconds",
    r"what is there": "a noun: the blocks, the results",
    r"what that is worth": "how large its error is",
    r"at a price": "with a penalty",
    r"could have had": "had a limit of",
    r"\bA reservation:": "a sentence that says what is limited",
    r"is told by": "follows from, or: is given by",
    r"utili[sz]e[sd]?\b": "use",
    r"in order to\b": "to",
    r"\bhence\b": "therefore, or a new sentence",
    r"simply|obviously|\bof course\b": "nothing",
    r"\bprice\b": "penalty, or time",
    r"what comes\b|what there is|what is left": "a noun: the results, the rest",
    r"goes on where": "continues",
}
"""What is not written, as a pattern, and what is written instead."""
