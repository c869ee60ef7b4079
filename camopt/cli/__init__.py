"""The command line: its parser, its verbs, and the values they take."""

from camopt.cli.parser import main as main
