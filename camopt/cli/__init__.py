"""The command line: its parser, its verbs, and the types of their arguments."""

from camopt.cli.parser import main as main
