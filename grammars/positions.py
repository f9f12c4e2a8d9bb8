"""Where in a TOML text each key and each element stands, so that an error can name its line."""

from bisect import bisect_right

Place = tuple[str | int, ...]
"""Keys and indices from the top of the document, as ('rules', 2, 'parts', 0, 'width_m')."""

_ESCAPES = {"b": "\b", "t": "\t", "n": "\n", "f": "\f", "r": "\r"}
_BLANK = " \t"


def line_numbers(text: str) -> dict[Place, int]:
    """Return the line, from 1, of every table, key and array element of a valid TOML text."""
    scanner = _Scanner(text)
    scanner.scan()
    return scanner.lines


class _Scanner:
    """One walk over a text that `tomllib` has accepted: nothing is checked again."""

    def __init__(self, text: str) -> None:
        self.text, self.at = text.replace("\r\n", "\n"), 0
        self.starts = [0] + [i + 1 for i, c in enumerate(self.text) if c == "\n"]
        self.lines: dict[Place, int] = {(): 1}
        self.arrays: dict[Place, int] = {}
        """how many tables an array of tables has so far"""

    def scan(self) -> None:
        table: Place = ()
        while self._skip_to_content():
            if self._peek("["):
                table = self._header()
            else:
                self._pair(table)

    def _header(self) -> Place:
        start = self.at
        array = self._peek("[[")
        self.at += 2 if array else 1
        *parents, last = self._key()
        place: Place = ()
        for key in parents:
            self._mark((*place, key), start)
            place = self._current((*place, key))
        place = (*place, last)
        if array:
            self.arrays[place] = self.arrays.get(place, 0) + 1
            self._mark(place, start)
            place = self._current(place)
        self._mark(place, start)
        self._skip_blank()
        self.at += 2 if array else 1
        return place

    def _current(self, place: Place) -> Place:
        """Return the place itself, or that of its last table if it is an array of tables."""
        return (*place, self.arrays[place] - 1) if place in self.arrays else place

    def _pair(self, table: Place) -> None:
        start = self.at
        place = table
        for key in self._key():
            place = (*place, key)
            self._mark(place, start)
        self.at = self.text.index("=", self.at) + 1
        self._skip_blank()
        self._value(place)

    def _value(self, place: Place) -> None:
        if self._peek('"""') or self._peek("'''"):
            self._long_string()
        elif self._peek('"') or self._peek("'"):
            self._string()
        elif self._peek("["):
            self._elements(place)
        elif self._peek("{"):
            self._inline_table(place)
        else:
            while self.at < len(self.text) and self.text[self.at] not in ",]}#\n":
                self.at += 1

    def _elements(self, place: Place) -> None:
        self.at += 1
        index = 0
        while self._skip_to_content() and not self._peek("]"):
            if self._peek(","):
                self.at += 1
                continue
            self._mark((*place, index), self.at)
            self._value((*place, index))
            index += 1
        self.at += 1

    def _inline_table(self, place: Place) -> None:
        self.at += 1
        while self._skip_to_content() and not self._peek("}"):
            if self._peek(","):
                self.at += 1
            else:
                self._pair(place)
        self.at += 1

    def _key(self) -> list[str]:
        keys = [self._simple_key()]
        while self._skip_blank() and self._peek("."):
            self.at += 1
            keys.append(self._simple_key())
        return keys

    def _simple_key(self) -> str:
        self._skip_blank()
        if self._peek('"') or self._peek("'"):
            return self._string()
        start = self.at
        while self.text[self.at].isalnum() or self.text[self.at] in "_-":
            self.at += 1
        return self.text[start : self.at]

    def _string(self) -> str:
        quote = self.text[self.at]
        self.at += 1
        found = []
        while self.text[self.at] != quote:
            if quote == '"' and self.text[self.at] == "\\":
                found.append(self._escape())
            else:
                found.append(self.text[self.at])
                self.at += 1
        self.at += 1
        return "".join(found)

    def _escape(self) -> str:
        letter = self.text[self.at + 1]
        digits = {"u": 4, "U": 8}.get(letter, 0)
        code = self.text[self.at + 2 : self.at + 2 + digits]
        self.at += 2 + digits
        return chr(int(code, 16)) if digits else _ESCAPES.get(letter, letter)

    def _long_string(self) -> None:
        quotes = self.text[self.at : self.at + 3]
        self.at += 3
        while not self._peek(quotes):
            self.at += 2 if quotes == '"""' and self._peek("\\") else 1
        while self._peek(quotes[0]):  # up to two quotes may stand before the closing three
            self.at += 1

    def _skip_blank(self) -> bool:
        while self.at < len(self.text) and self.text[self.at] in _BLANK:
            self.at += 1
        return self.at < len(self.text)

    def _skip_to_content(self) -> bool:
        """Go to what is neither blank, line break nor comment; return whether there is any."""
        while self._skip_blank() and self.text[self.at] in "#\n":
            if self.text[self.at] == "#":
                end = self.text.find("\n", self.at)
                self.at = len(self.text) if end < 0 else end
            else:
                self.at += 1
        return self.at < len(self.text)

    def _peek(self, what: str) -> bool:
        return self.text.startswith(what, self.at)

    def _mark(self, place: Place, at: int) -> None:
        self.lines.setdefault(place, bisect_right(self.starts, at))
