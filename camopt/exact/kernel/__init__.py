"""The compiled kernel of event-exact: exact propagators advance the state over spans, inside which all switchings are
located."""
