"""Steps from the decimals of a method, and written out in words, factor by factor, from the definition."""

from fractions import Fraction

LETTERS = {"A": {"A": 1}, "B": {"B": 1}, "C": {"BAB": 2, "ABB": -1, "BBA": -1}}


def operators_of(tableau, number=Fraction):
    """The operators of a step in their order, from the decimals: A drifts, B kicks, C kicks of the square."""
    kicks = [[("B", number(text))] for text in tableau.kick]
    for operators, text in zip(kicks, getattr(tableau, "square", ()), strict=False):
        if number(text):
            operators.append(("C", number(text)))
    drifts = [[("A", number(text))] for text in tableau.drift]
    rows = (kicks, drifts) if tableau.first == "kick" else (drifts, kicks)
    return [x for i in range(len(rows[0])) for row in rows for operators in row[i : i + 1] for x in operators]


def series(step, length):
    """Coefficients of exp(c1 X1) exp(c2 X2) ... on words of at most ``length`` letters, without those that are 0."""
    total = {"": Fraction(1)}
    for letter, c in step:
        power = exponential = {"": Fraction(1)}
        for k in range(1, length + 1):
            power = times(power, {word: a * c / k for word, a in LETTERS[letter].items()}, length)
            exponential = plus(exponential, power)
        total = times(total, exponential, length)
    return total


def plus(x, y):
    return {word: x.get(word, 0) + y.get(word, 0) for word in x | y}


def times(x, y, length):
    total = {}
    for u, a in x.items():
        for v, b in y.items():
            if len(u) + len(v) <= length:
                total[u + v] = total.get(u + v, 0) + a * b
    return total
