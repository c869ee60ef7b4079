"""A parser of arguments that names the command, option or word that was probably meant."""

import argparse
import sys
from collections.abc import Callable, Sequence

from camopt.scene.spelling import did_you_mean
from camopt.scene.text_file import excerpt


class SuggestingParser(argparse.ArgumentParser):
    """As argparse's; unknown commands and options are refused first, with a suggestion, before anything is missed."""

    def __init__(self, *args, **options):
        self.known: set[str] = set()
        self.verbs: list[str] = []
        super().__init__(*args, **options)

    def add_argument(self, *names, **options):
        """`choices` become a type, whose sentence suggests one of them."""
        choices = options.pop("choices", None)
        if choices is not None:
            options |= {"type": one_of(choices), "metavar": options.get("metavar", f"{{{','.join(choices)}}}")}
        action = super().add_argument(*names, **options)
        self.known.update(action.option_strings)
        return action

    def parse_known_args(self, args=None, namespace=None):  # pyright: ignore[reportIncompatibleMethodOverride]
        """As argparse's, which every parser of a command goes through."""
        for word in sys.argv[1:] if args is None else args:
            name = word.partition("=")[0]
            if word == "--":
                break
            if word.startswith("--"):
                if name not in self.known:
                    self.error(f"no option {excerpt(name)}{did_you_mean(name, self.known)}")
            elif self.verbs and not word.startswith("-"):
                if word not in self.verbs:
                    meant = did_you_mean(word, self.verbs) or f": expected one of {', '.join(self.verbs)}"
                    self.error(f"no command {excerpt(word)}{meant}")
                break
        return super().parse_known_args(args, namespace)


def one_of(choices: Sequence[str]) -> Callable[[str], str]:
    """A word out of some, as argparse wants a type."""

    def word(text: str) -> str:
        if text not in choices:
            expected = f"{', '.join(choices[:-1])} or {choices[-1]}" if len(choices) > 1 else choices[0]
            raise argparse.ArgumentTypeError(f"{excerpt(text)}: expected {expected}{did_you_mean(text, choices)}")
        return text

    return word
