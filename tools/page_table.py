"""A table of a page in Markdown, of which a command writes some rows and leaves the others and the text as they are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

Row = tuple[str, ...]


def line_of(cells: Iterable[str]) -> str:
    """A line of a table."""
    return f"| {' | '.join(cells)} |"


def rows_of(text: str, head: Sequence[str]) -> dict[str, Row]:
    """The rows of the table below `head`, by their first cells; none if the page has no such table."""
    rows = {}
    for line in text.partition(line_of(head))[2].splitlines()[2:]:
        if not line.startswith("|"):
            break
        cells = tuple(cell.strip() for cell in line.strip("|").split("|"))
        rows[cells[0]] = cells
    return rows


def with_rows(text: str, head: Sequence[str], rows: Mapping[str, Row]) -> str:
    """The page with these rows among those of its table, in the order of their first cells; the rest as it is.

    Raises
    ------
    ValueError
        If the page has no table with this head.
    """
    before, found, after = text.partition(line_of(head))
    if not found:
        raise ValueError(f"the page has no table with the head {line_of(head)}: put it where the rows are to go")
    rest = after.splitlines(keepends=True)[1:]
    while rest and rest[0].startswith("|"):
        rest.pop(0)
    whole = {**rows_of(text, head), **rows}
    lines = [found, "|---" * len(head) + "|", *(line_of(whole[name]) for name in sorted(whole))]
    return before + "\n".join(lines) + "\n" + "".join(rest)
