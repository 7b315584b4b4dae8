"""The page of the study: what was ambiguous, what was added, what was left."""

from __future__ import annotations

from typing import Any, Final

from studies.cannot_tell.cases import CASES
from studies.gap.rows import Found, mark_of, states_in_words

_WORDS: Final = {
    "resolved": "**yes**",
    "clear": "was clear at first",
    "smaller": "in part",
    "open": "**no**",
    "wrong": "**no, truth lost**",
}

_WHY: Final = {
    "bounce": "The generator's hop lasts as long at every speed, the library's longer the faster the wall "
    "comes: in all that is read of it, it is the library's dwell (gap-method.md, *What cannot be "
    "separated*). The second mark on the accelerometers, which the library names, is not read.",
    "pivot_shift": "Measured with heights of the LVDTs' points that are free to 50 mm. Where they are the "
    "rig file's to 5 mm, this and the rounded edge are named at the first (gap-effects.md).",
    "filter_delay@wire": "The step rules the delay out, as it is said to; a wire that swings on its spring "
    "(at 5 to 6 %) changes a step too, and stays.",
    "ambient": "Without accelerometers nothing shows that the floor moves; the gate refuses every other "
    "explanation.",
}
"""Reasons for rows that are no plain ambiguity, by the name of the truth."""


def outcome(found: Found) -> str:
    """One of the keys of the words: resolved, clear (nothing was ambiguous), smaller, open or wrong."""
    truth = [found["truth"]]
    first, second = found["first"]["set95"], found["second"]["set95"]
    if truth not in second:
        return "wrong"
    if len(first) < 2 or truth not in first:
        return "clear" if first == [truth] else "open" if len(second) > 1 else "resolved"
    if second == [truth]:
        return "resolved"
    return "smaller" if len(second) < len(first) else "open"


def page(found: list[Found]) -> str:
    """The tables as Markdown, with what did not come out."""
    lines = [
        "# Cannot tell A from B: does the measurement that is named resolve it?",
        "",
        "`python -m studies.cannot_tell --seed S` for each seed (the last with `--page "
        "docs/explanation/gap-cannot-tell.md` writes this page). A wall with one effect comes from the "
        "blind check's generator, which shares no code with the diagnosis (wall, sensors and runs drawn "
        "from the seed; restitution scatter 0.2 to 0.8 %). It is diagnosed from little; then the "
        "measurement that the library names for the pair is added, for the same wall with the same "
        "sensors, and it is diagnosed "
        "again. *Set*: the 95 % set with probabilities, forms that the library declares indistinguishable "
        "each by itself. *Resolved*: the set has shrunk to the truth alone. What is read by hand (a level, a "
        f"rule, a knock) is one more feature with its own error. {states_in_words(found)}",
        "",
        *_counts(found),
        "",
        "| truth | seed | recorded at first | set | the diagnosis asks for | added | set | resolved |",
        "|---|---|---|---|---|---|---|---|",
        *(_row(f) for f in found),
        "",
        "- Strengths, and what little is, were chosen on seed 1; seed 2 was run after.",
        *_asked(found),
        *(f"- **{name}**: {why}" for name, why in _WHY.items() if any(f["truth"] == name for f in found)),
    ]
    seconds = sorted(f["cpu_s"] for f in found)
    if seconds:
        middle = seconds[len(seconds) // 2]
        lines += [
            "",
            f"Processor time per row, both diagnoses and the simulation: median {middle:.0f} s, "
            f"at most {seconds[-1]:.0f} s.",
        ]
    return "\n".join(lines) + "\n"


def _counts(found: list[Found]) -> list[str]:
    """How many were ambiguous, and what became of them."""
    ambiguous = [f for f in found if len(f["first"]["set95"]) > 1]
    kinds = [outcome(f) for f in ambiguous]
    resolved = kinds.count("resolved")
    held = sum([f["truth"]] in f["first"]["set95"] for f in ambiguous)
    said = sum(_says_so(f) for f in ambiguous)
    lines = [
        f"{len(found)} rows; in {len(ambiguous)} the first set held several hypotheses (the truth among "
        f"them in {held}). Of these the measurement left the truth alone in {resolved}, a smaller set with "
        f"the truth in it in {kinds.count('smaller')}, one no smaller in {kinds.count('open')}, and one "
        f"without the truth in {kinds.count('wrong')}. In {said} of them the first diagnosis said that it "
        "could not tell, or named the forms that it cannot tell apart; in the others its verdict was "
        "another, though the set was open (one test of one level: other parameters explain it as well).",
        "",
    ]
    for seed in sorted({f["seed"] for f in ambiguous}):
        mine = [outcome(f) for f in ambiguous if f["seed"] == seed]
        lines.append(f"- Seed {seed}: {mine.count('resolved')} of {len(mine)} resolved.")
    lost = [f for f in found if outcome(f) == "wrong" and len(f["first"]["set95"]) == 1]
    if lost:
        names = ", ".join(f"{f['truth']} (seed {f['seed']})" for f in lost)
        lines.append(f"- Named wrongly from the first, with nothing else in the set: {names}.")
    return lines


def _says_so(found: Found) -> bool:
    """Whether the first diagnosis says itself that it cannot tell."""
    first = found["first"]
    return first["decision"] == "cannot_tell" or "which no sensor here tells apart" in first["sentence"]


def _row(f: Found) -> str:
    strength = ", ".join(f"{name} {value:g}" for name, value in f["parameters"].items())
    kind = outcome(f)
    cells = (
        f"{f['truth']}{mark_of(f)} ({strength})",
        str(f["seed"]),
        f["little"],
        _set(f["first"]),
        f["first"]["next"].rstrip("."),
        "" if kind == "clear" else f["added"],
        "" if kind == "clear" else _set(f["second"]),
        _WORDS[kind],
    )
    return "| " + " | ".join(cells) + " |"


def _set(answer: dict[str, Any]) -> str:
    known = {tuple(effects): probability for effects, probability in answer["top"]}
    words = []
    for effects in answer["set95"]:
        name = " + ".join(effects) or "nothing missing"
        probability = known.get(tuple(effects))
        words.append(name if probability is None else f"{name} {probability:.2f}")
    return f"{answer['decision'].replace('_', ' ')}: {', '.join(words) or answer['sentence']}"


def _asked(found: list[Found]) -> list[str]:
    """Where the first diagnosis asked for something else than the library names for this pair."""
    other = [
        f for f in found if len(f["first"]["set95"]) > 1 and CASES[f["case"]].named not in f["first"]["next"]
    ]
    if not other:
        return []
    words = ", ".join(f"{f['truth']} (seed {f['seed']})" for f in other)
    return [f"- The first diagnosis asked for something else than was added: {words}."]
